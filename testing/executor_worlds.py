"""Further local worlds of `default_executor.py`, one function for each kind. Each returns the domain and the problem.

Most of them have numbers that change continuously, actions that must overlap in part, or conditions with several facts.
The planner makes the first plan.
"""


def problem(domain, objects, initial, goal):
    return f"""(define (problem p) (:domain {domain}) (:objects {objects})
  (:init {initial}) (:goal (and {goal})))
"""


def kitchen(dishes, degrees, finish):
    """An oven whose temperature rises while it heats and falls while it cools; baked dishes need heat all the time."""
    domain = """(define (domain kitchen)
  (:requirements :typing :durative-actions :numeric-fluents :continuous-effects :duration-inequalities
    :negative-preconditions)
  (:types dish) (:predicates (burning) (cooling) (free) (raw ?d - dish) (baked ?d - dish)) (:functions (heat))
  (:durative-action burn :parameters () :duration (and (>= ?duration 5) (<= ?duration 100))
    :condition (and (at start (not (burning))) (over all (<= (heat) 250)))
    :effect (and (at start (burning)) (at end (not (burning))) (increase (heat) (* #t 4))))
  (:durative-action cool :parameters () :duration (and (>= ?duration 1) (<= ?duration 200))
    :condition (and (at start (not (cooling))) (at start (not (burning))) (over all (>= (heat) 10)))
    :effect (and (at start (cooling)) (at end (not (cooling))) (decrease (heat) (* #t 2))))
  (:durative-action bake :parameters (?d - dish) :duration (= ?duration 20)
    :condition (and (at start (free)) (at start (raw ?d)) (over all (>= (heat) 180)))
    :effect (and (at start (not (free))) (at start (not (raw ?d))) (at end (free)) (at end (baked ?d)))))
"""
    names = [f"d{it}" for it in range(dishes)]
    initial = f"(free) (= (heat) {degrees}) {' '.join(f'(raw {it})' for it in names)}"
    goal = f"(<= (heat) {finish}) {' '.join(f'(baked {it})' for it in names)}"
    return domain, problem("kitchen", f"{' '.join(names)} - dish", initial, goal)


def clips(parts, clamp, weld):
    """A weld must begin before the clamp ends, and end after it. A weld that is too early can be repeated."""
    domain = f"""(define (domain clips) (:requirements :typing :durative-actions)
  (:types part)
  (:predicates (loose ?p - part) (held ?p - part) (warm ?p - part) (fixed ?p - part) (done ?p - part) (arm))
  (:durative-action clamp :parameters (?p - part) :duration (= ?duration {clamp})
    :condition (and (at start (arm)) (at start (loose ?p)) (at end (warm ?p)))
    :effect (and (at start (not (arm))) (at start (not (loose ?p))) (at start (held ?p)) (at end (fixed ?p))
      (at end (arm))))
  (:durative-action weld :parameters (?p - part) :duration (= ?duration {weld})
    :condition (and (at start (held ?p)) (at end (fixed ?p)))
    :effect (and (at start (warm ?p)) (at end (done ?p)))))
"""
    names = [f"p{it}" for it in range(parts)]
    initial = f"(arm) {' '.join(f'(loose {it})' for it in names)}"
    return domain, problem("clips", f"{' '.join(names)} - part", initial, " ".join(f"(done {it})" for it in names))


def doors(loads, opens, closes):
    """A robot passes doors that helpers hold open from either side; the ward is closed at some times."""
    domain = """(define (domain doors)
  (:requirements :typing :durative-actions :negative-preconditions :disjunctive-preconditions
    :duration-inequalities :timed-initial-literals)
  (:types place helper load)
  (:predicates (at-robot ?p - place) (stands ?h - helper ?p - place) (door ?a ?b - place) (ajar ?a ?b - place)
    (idle ?h - helper) (still) (empty) (on ?l - load) (lies ?l - load ?p - place) (shut ?p - place))
  (:durative-action hold :parameters (?h - helper ?a ?b - place)
    :duration (and (>= ?duration 1) (<= ?duration 9))
    :condition (and (at start (door ?a ?b)) (over all (stands ?h ?a)) (at start (idle ?h)))
    :effect (and (at start (not (idle ?h))) (at end (idle ?h)) (at start (ajar ?a ?b)) (at end (not (ajar ?a ?b)))))
  (:durative-action pass :parameters (?a ?b - place) :duration (= ?duration 5)
    :condition (and (at start (at-robot ?a)) (at start (still)) (over all (or (ajar ?a ?b) (ajar ?b ?a)))
      (over all (not (shut ?b))))
    :effect (and (at start (not (at-robot ?a))) (at start (not (still))) (at end (at-robot ?b)) (at end (still))))
  (:durative-action take :parameters (?l - load ?p - place) :duration (= ?duration 2)
    :condition (and (over all (at-robot ?p)) (at start (still)) (at start (empty)) (at start (lies ?l ?p)))
    :effect (and (at start (not (still))) (at start (not (empty))) (at start (not (lies ?l ?p))) (at end (on ?l))
      (at end (still))))
  (:durative-action give :parameters (?l - load ?p - place) :duration (= ?duration 2)
    :condition (and (over all (at-robot ?p)) (at start (still)) (at start (on ?l)))
    :effect (and (at start (not (still))) (at start (not (on ?l))) (at end (lies ?l ?p)) (at end (empty))
      (at end (still)))))
"""
    names = [f"l{it}" for it in range(loads)]
    initial = f"""(at-robot store) (still) (empty) (door store ward) (door ward store) (stands h0 store) (stands h1 ward)
    (idle h0) (idle h1) (at {opens} (shut ward)) (at {closes} (not (shut ward)))
    {' '.join(f'(lies {it} store)' for it in names)}"""
    objects = f"store ward - place h0 h1 - helper {' '.join(names)} - load"
    return domain, problem("doors", objects, initial, " ".join(f"(lies {it} ward)" for it in names))


def tank(batches, level, most):
    """A tank that is filled and emptied by pumps; each batch needs the level to stay within bounds."""
    domain = f"""(define (domain tank)
  (:requirements :typing :durative-actions :numeric-fluents :continuous-effects :duration-inequalities)
  (:types batch) (:predicates (inlet) (outlet) (mixer) (wet ?b - batch)) (:functions (level))
  (:durative-action fill :parameters () :duration (and (>= ?duration 2) (<= ?duration 30))
    :condition (and (at start (inlet)) (over all (<= (level) {most})))
    :effect (and (at start (not (inlet))) (at end (inlet)) (increase (level) (* #t 3))))
  (:durative-action drain :parameters () :duration (and (>= ?duration 2) (<= ?duration 30))
    :condition (and (at start (outlet)) (over all (>= (level) 0)))
    :effect (and (at start (not (outlet))) (at end (outlet)) (decrease (level) (* #t 2))))
  (:durative-action mix :parameters (?b - batch) :duration (= ?duration 8)
    :condition (and (at start (mixer)) (over all (>= (level) 20)) (over all (<= (level) 40)))
    :effect (and (at start (not (mixer))) (at end (mixer)) (at end (wet ?b)))))
"""
    names = [f"b{it}" for it in range(batches)]
    goal = f"(<= (level) 10) {' '.join(f'(wet {it})' for it in names)}"
    return domain, problem("tank", f"{' '.join(names)} - batch", f"(inlet) (outlet) (mixer) (= (level) {level})", goal)


def sunlight(sites, charge, night):
    """A rover that drains its battery while it drives, and charges it in the sun while it works."""
    domain = """(define (domain sunlight)
  (:requirements :typing :durative-actions :numeric-fluents :continuous-effects :duration-inequalities
    :timed-initial-literals)
  (:types site) (:predicates (at ?s - site) (road ?a ?b - site) (sun) (still) (awake) (seen ?s - site))
  (:functions (charge))
  (:durative-action drive :parameters (?a ?b - site) :duration (= ?duration 10)
    :condition (and (at start (at ?a)) (at start (still)) (at start (road ?a ?b)) (over all (>= (charge) 0)))
    :effect (and (at start (not (at ?a))) (at start (not (still))) (at end (at ?b)) (at end (still))
      (decrease (charge) (* #t 2))))
  (:durative-action bask :parameters () :duration (and (>= ?duration 3) (<= ?duration 40))
    :condition (and (at start (awake)) (over all (sun)) (over all (still)) (over all (<= (charge) 50)))
    :effect (and (at start (not (awake))) (at end (awake)) (increase (charge) (* #t 1))))
  (:durative-action look :parameters (?s - site) :duration (= ?duration 6)
    :condition (and (over all (at ?s)) (over all (>= (charge) 5)))
    :effect (and (at end (seen ?s)) (decrease (charge) (* #t 1)))))
"""
    names = [f"s{it}" for it in range(sites)]
    roads = " ".join(f"(road {a} {b})" for a, b in zip(names, names[1:]))
    initial = f"(at s0) (still) (awake) (sun) (= (charge) {charge}) {roads} (at {night} (not (sun)))"
    return domain, problem("sunlight", f"{' '.join(names)} - site", initial, " ".join(f"(seen {it})" for it in names))


def coats(parts, dry, deadline):
    """Paint in two coats: the second one begins while the first one dries, and ends before it is dry."""
    domain = f"""(define (domain coats) (:requirements :typing :durative-actions :timed-initial-literals)
  (:types part) (:predicates (bare ?p - part) (tacky ?p - part) (booth) (brush) (coated ?p - part) (day))
  (:durative-action dry :parameters (?p - part) :duration (= ?duration {dry})
    :condition (and (at start (bare ?p)) (at start (booth)))
    :effect (and (at start (not (bare ?p))) (at start (not (booth))) (at start (tacky ?p)) (at end (not (tacky ?p)))
      (at end (booth))))
  (:durative-action coat :parameters (?p - part) :duration (= ?duration 5)
    :condition (and (at start (brush)) (over all (tacky ?p)) (over all (day)))
    :effect (and (at start (not (brush))) (at end (brush)) (at end (coated ?p)))))
"""
    names = [f"p{it}" for it in range(parts)]
    initial = f"(booth) (brush) (day) {' '.join(f'(bare {it})' for it in names)} (at {deadline} (not (day)))"
    return domain, problem("coats", f"{' '.join(names)} - part", initial, " ".join(f"(coated {it})" for it in names))


def trains(parcels, first, pause):
    """Parcels that are packed, and loaded while a train stops; trains stop again and again for a short time."""
    domain = """(define (domain trains) (:requirements :typing :durative-actions :timed-initial-literals)
  (:types parcel) (:predicates (train) (hand) (cart) (loose ?p - parcel) (packed ?p - parcel) (sent ?p - parcel))
  (:durative-action pack :parameters (?p - parcel) :duration (= ?duration 7)
    :condition (and (at start (hand)) (at start (loose ?p)))
    :effect (and (at start (not (hand))) (at end (hand)) (at end (packed ?p))))
  (:durative-action load :parameters (?p - parcel) :duration (= ?duration 4)
    :condition (and (at start (cart)) (at start (packed ?p)) (over all (train)))
    :effect (and (at start (not (cart))) (at end (cart)) (at end (sent ?p)))))
"""
    names = [f"p{it}" for it in range(parcels)]
    stops = [first + pause * it for it in range(4)]
    times = " ".join(f"(at {it} (train)) (at {it + 9} (not (train)))" for it in stops)
    initial = f"(hand) (cart) {' '.join(f'(loose {it})' for it in names)} {times}"
    return domain, problem("trains", f"{' '.join(names)} - parcel", initial, " ".join(f"(sent {it})" for it in names))


def crane(crates, capacity, deadline):
    """Crates of different weight on a scale with a limit, weighed for different times, with a deadline."""
    domain = f"""(define (domain crane)
  (:requirements :typing :durative-actions :numeric-fluents :timed-initial-literals)
  (:types crate) (:predicates (waiting ?c - crate) (weighed ?c - crate) (open)) (:functions (load) (weight ?c - crate))
  (:durative-action weigh :parameters (?c - crate) :duration (= ?duration (+ 2 (weight ?c)))
    :condition (and (at start (waiting ?c)) (over all (<= (load) {capacity})) (over all (open)))
    :effect (and (at start (not (waiting ?c))) (at start (increase (load) (weight ?c)))
      (at end (decrease (load) (weight ?c))) (at end (weighed ?c)))))
"""
    names = [f"c{it}" for it in range(crates)]
    weights = " ".join(f"(waiting {it}) (= (weight {it}) {2 + place % 3})" for place, it in enumerate(names))
    initial = f"(open) (= (load) 0) {weights} (at {deadline} (not (open)))"
    return domain, problem("crane", f"{' '.join(names)} - crate", initial, " ".join(f"(weighed {it})" for it in names))


def forge(pieces, hot, deadline):
    """Pieces that are heated, and hammered twice while they are hot; a piece that has cooled can be heated again."""
    domain = f"""(define (domain forge) (:requirements :typing :durative-actions :timed-initial-literals)
  (:types piece)
  (:predicates (cold ?p - piece) (glows ?p - piece) (ready ?p - piece) (bent ?p - piece) (shaped ?p - piece) (fire)
    (anvil) (shift))
  (:durative-action heat :parameters (?p - piece) :duration (= ?duration 6)
    :condition (and (at start (fire)) (at start (cold ?p)))
    :effect (and (at start (not (fire))) (at end (fire)) (at start (not (cold ?p))) (at end (ready ?p))))
  (:durative-action glow :parameters (?p - piece) :duration (= ?duration {hot}) :condition (at start (ready ?p))
    :effect (and (at start (not (ready ?p))) (at start (glows ?p)) (at end (not (glows ?p))) (at end (cold ?p))))
  (:durative-action bend :parameters (?p - piece) :duration (= ?duration 3)
    :condition (and (at start (anvil)) (over all (glows ?p)) (over all (shift)))
    :effect (and (at start (not (anvil))) (at end (anvil)) (at end (bent ?p))))
  (:durative-action shape :parameters (?p - piece) :duration (= ?duration 4)
    :condition (and (at start (anvil)) (at start (bent ?p)) (over all (glows ?p)) (over all (shift)))
    :effect (and (at start (not (anvil))) (at end (anvil)) (at end (shaped ?p)))))
"""
    names = [f"p{it}" for it in range(pieces)]
    initial = f"(fire) (anvil) (shift) {' '.join(f'(cold {it})' for it in names)} (at {deadline} (not (shift)))"
    return domain, problem("forge", f"{' '.join(names)} - piece", initial, " ".join(f"(shaped {it})" for it in names))


def ferry(cars, deadline):
    """A ferry with two places. It waits at a bank while cars board, and crosses with a fast or a slow engine."""
    domain = """(define (domain ferry)
  (:requirements :typing :durative-actions :numeric-fluents :timed-initial-literals)
  (:types car bank)
  (:predicates (lands ?b - bank) (at ?c - car ?b - bank) (aboard ?c - car) (other ?a ?b - bank) (day) (idle))
  (:functions (places) (fuel))
  (:durative-action board :parameters (?c - car ?b - bank) :duration (= ?duration 2)
    :condition (and (at start (at ?c ?b)) (over all (lands ?b)) (at start (>= (places) 1)))
    :effect (and (at start (not (at ?c ?b))) (at start (decrease (places) 1)) (at end (aboard ?c))))
  (:durative-action leave :parameters (?c - car ?b - bank) :duration (= ?duration 2)
    :condition (and (at start (aboard ?c)) (over all (lands ?b)) (over all (day)))
    :effect (and (at start (not (aboard ?c))) (at end (increase (places) 1)) (at end (at ?c ?b))))
  (:durative-action sail :parameters (?a ?b - bank) :duration (= ?duration 12)
    :condition (and (at start (lands ?a)) (at start (other ?a ?b)) (at start (idle)))
    :effect (and (at start (not (lands ?a))) (at start (not (idle))) (at end (idle)) (at end (lands ?b))))
  (:durative-action rush :parameters (?a ?b - bank) :duration (= ?duration 7)
    :condition (and (at start (lands ?a)) (at start (other ?a ?b)) (at start (idle)) (at start (>= (fuel) 5)))
    :effect (and (at start (not (lands ?a))) (at start (not (idle))) (at start (decrease (fuel) 5)) (at end (idle))
      (at end (lands ?b)))))
"""
    names = [f"c{it}" for it in range(cars)]
    initial = f"""(lands west) (other west east) (other east west) (idle) (day) (= (places) 2) (= (fuel) 10)
    {' '.join(f'(at {it} west)' for it in names)} (at {deadline} (not (day)))"""
    objects = f"{' '.join(names)} - car west east - bank"
    return domain, problem("ferry", objects, initial, " ".join(f"(at {it} east)" for it in names))


def bridge(walkers, torch, deadline):
    """Walkers with different paces cross a bridge in the light of lamps; each lamp burns for some time only."""
    domain = f"""(define (domain bridge)
  (:requirements :typing :durative-actions :numeric-fluents :timed-initial-literals)
  (:types walker lamp) (:predicates (near ?w - walker) (far ?w - walker) (unlit ?l - lamp) (light ?l - lamp) (open)
    (rail)) (:functions (pace ?w - walker))
  (:durative-action burn :parameters (?l - lamp) :duration (= ?duration {torch}) :condition (at start (unlit ?l))
    :effect (and (at start (not (unlit ?l))) (at start (light ?l)) (at end (not (light ?l)))))
  (:durative-action cross :parameters (?w - walker ?l - lamp) :duration (= ?duration (pace ?w))
    :condition (and (at start (near ?w)) (at start (rail)) (over all (light ?l)) (over all (open)))
    :effect (and (at start (not (near ?w))) (at start (not (rail))) (at end (rail)) (at end (far ?w)))))
"""
    names = [f"w{it}" for it in range(walkers)]
    paces = " ".join(f"(near {it}) (= (pace {it}) {3 + 2 * (place % 3)})" for place, it in enumerate(names))
    initial = f"(open) (rail) (unlit l0) (unlit l1) (unlit l2) {paces} (at {deadline} (not (open)))"
    objects = f"{' '.join(names)} - walker l0 l1 l2 - lamp"
    return domain, problem("bridge", objects, initial, " ".join(f"(far {it})" for it in names))


def pumps(fields, store, deadline):
    """Fields that are watered from a store; a well refills it, and both may run at the same time."""
    domain = """(define (domain pumps)
  (:requirements :typing :durative-actions :numeric-fluents :continuous-effects :duration-inequalities
    :timed-initial-literals)
  (:types field) (:predicates (dry ?f - field) (green ?f - field) (well) (hose) (day)) (:functions (store))
  (:durative-action refill :parameters () :duration (and (>= ?duration 5) (<= ?duration 50))
    :condition (and (at start (well)) (over all (<= (store) 100)))
    :effect (and (at start (not (well))) (at end (well)) (increase (store) (* #t 2))))
  (:durative-action water :parameters (?f - field) :duration (= ?duration 10)
    :condition (and (at start (dry ?f)) (at start (hose)) (over all (>= (store) 0)) (over all (day)))
    :effect (and (at start (not (dry ?f))) (at start (not (hose))) (at end (hose)) (at end (green ?f))
      (decrease (store) (* #t 3)))))
"""
    names = [f"f{it}" for it in range(fields)]
    initial = f"""(well) (hose) (day) (= (store) {store}) {' '.join(f'(dry {it})' for it in names)}
    (at {deadline} (not (day)))"""
    return domain, problem("pumps", f"{' '.join(names)} - field", initial, " ".join(f"(green {it})" for it in names))


KINDS = {
    "kitchen": (kitchen, ((1, 20, 60), (2, 20, 60), (2, 150, 150))),
    "clips": (clips, ((1, 10, 3), (3, 10, 3), (2, 8, 6))),
    "doors": (doors, ((1, 40, 60), (2, 20, 40), (2, 12, 30))),
    "tank": (tank, ((1, 0, 60), (2, 10, 45), (3, 50, 60))),
    "sunlight": (sunlight, ((2, 40, 60), (3, 25, 80), (3, 45, 50))),
    "coats": (coats, ((1, 8, 20), (2, 8, 25), (3, 7, 60))),
    "trains": (trains, ((2, 8, 20), (4, 10, 15), (3, 16, 40))),
    "crane": (crane, ((3, 6, 20), (5, 6, 20), (6, 8, 18))),
    "forge": (forge, ((1, 9, 40), (2, 8, 40), (3, 12, 50))),
    "ferry": (ferry, ((2, 20), (4, 50), (6, 70))),
    "bridge": (bridge, ((3, 20, 30), (5, 10, 60), (6, 12, 40))),
    "pumps": (pumps, ((2, 30, 60), (4, 40, 60), (3, 10, 50))),
}


def worlds():
    """All worlds by name: domain, problem, and no plan."""
    found = {}
    for kind, (make, variants) in KINDS.items():
        for values in variants:
            found["-".join([kind, *map(str, values)])] = (*make(*values), None)
    return found
