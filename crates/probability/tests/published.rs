//! The authors' worlds: what their programs computed, where they computed it rightly.

mod shared;

use elbowroom_plan::{Node, NodeId};
use elbowroom_probability::dispatch::patient;
use elbowroom_probability::{Circumstances, OrderSearch, PrunedNetwork, SearchSettings, Semantics};

#[test]
fn the_order_of_the_published_runs_has_the_published_probability() {
    const PUBLISHED: [f64; 10] = [
        0.1575, 0.1541, 0.1459, 0.1381, 0.1305, 0.0877, 0.0756, 0.0647, 0.0656, 0.0407,
    ];
    for (world, published) in shared::sf3().iter().zip(PUBLISHED) {
        let model = world.model(Semantics::Paper);
        let initial = Circumstances::initial(&world.task);
        let mut network = PrunedNetwork::new(&model, &initial).unwrap();
        for node in [5, 6, 3, 4, 1, 2] {
            network.push(NodeId(node)).unwrap();
        }
        let p = network.success_probability().unwrap();
        assert!((p - published).abs() < 5e-5, "{}: {p}", world.name);
    }
    const PUBLISHED_AF3: [f64; 8] = [
        0.0201, 0.0125, 0.0079, 0.0052, 0.0159, 0.0092, 0.0071, 0.0051,
    ];
    for (world, published) in shared::af3().iter().zip(PUBLISHED_AF3) {
        let model = world.model(Semantics::Paper);
        let initial = Circumstances::initial(&world.task);
        let mut network = PrunedNetwork::new(&model, &initial).unwrap();
        let happenings = 1..world.plan.nodes.len();
        for node in happenings.map(NodeId::from) {
            assert!(matches!(
                world.plan.nodes[node.index()],
                Node::Start(_) | Node::End(_)
            ));
            network.push(node).unwrap();
        }
        let p = network.success_probability().unwrap();
        assert!((p - published).abs() < 6e-5, "{}: {p}", world.name);
    }
}

#[test]
fn the_best_order_is_found_also_where_the_published_search_missed_it() {
    const BEST: [f64; 10] = [
        0.1575, 0.1541, 0.1459, 0.1381, 0.1305, 0.0877, 0.0756, 0.0707, 0.0656, 0.0407,
    ];
    for (world, best) in shared::sf3().iter().zip(BEST) {
        let model = world.model(Semantics::Paper);
        let mut search = OrderSearch::new(model, SearchSettings::default());
        let found = search
            .best_order(&Circumstances::initial(&world.task), &mut patient)
            .unwrap();
        let order = found.order.unwrap();
        println!(
            "{} {:?} {} {}",
            world.name, order.sequence, order.probability, found.sequences
        );
        assert!(
            (order.probability - best).abs() < 5e-5,
            "{}: {}",
            world.name,
            order.probability
        );
    }
    const BEST_AF3: [f64; 8] = [
        0.0201, 0.0125, 0.0079, 0.0052, 0.0159, 0.0092, 0.0071, 0.0051,
    ];
    for (world, best) in shared::af3().iter().zip(BEST_AF3) {
        let model = world.model(Semantics::Paper);
        let mut search = OrderSearch::new(model, SearchSettings::default());
        let found = search
            .best_order(&Circumstances::initial(&world.task), &mut patient)
            .unwrap();
        let order = found.order.unwrap();
        println!(
            "{} {:?} {} {}",
            world.name, order.sequence, order.probability, found.sequences
        );
        assert!(
            (order.probability - best).abs() < 6e-5,
            "{}: {}",
            world.name,
            order.probability
        );
    }
}
