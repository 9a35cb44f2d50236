//! One small network in each format.

pub(crate) const HEATLAB: &str = r#"{
  "nodes": [{"node_id": 1}, {"node_id": 2, "min_domain": 0, "max_domain": 9000.5}, {"node_id": 3}],
  "constraints": [
    {"first_node": 0, "second_node": 1, "type": "stc", "min_duration": 0.0, "max_duration": "inf"},
    {"first_node": 1, "second_node": 2, "type": "stcu", "min_duration": 2000, "max_duration": 3000},
    {"first_node": 2, "second_node": 3, "type": "pstc", "min_duration": -Infinity,
     "max_duration": Infinity, "distribution": {"name": "N_4.5_0.5", "type": "Empirical"}},
    {"first_node": 1, "second_node": 3, "min_duration": 1, "max_duration": 20000}
  ], "num_agents": 1 }"#;

pub(crate) const PSTN_LIB: &str = r#"{ "name": "two drives",
  "timepoints": [{"id": 0, "label": "start"}, {"id": 1, "label": "(drive a)_end"},
                 {"id": 2, "label": "(drive a)_end"}],
  "constraints": [
    {"source": 0, "sink": 1, "label": "one", "type": "pstc",
     "distribution": {"mean": 10.0, "sd": 1.5}},
    {"source": 0, "sink": 2, "label": "two", "type": "pstc",
     "distribution": {"mean": 12.0, "sd": 2.0}},
    {"source": 0, "sink": 2, "label": "deadline", "type": "stc",
     "duration_bound": {"lb": 0, "ub": 1000000000}}
  ],
  "correlations": [{"constraints": [
      {"source": 0, "sink": 1, "type": "pstc", "distribution": {"mean": 10.0, "sd": 1.5}},
      {"source": 0, "sink": 2, "type": "pstc", "distribution": {"mean": 12.0, "sd": 2.0}}],
    "mean": [10.0, 12.0], "correlation": [[1.0, 0.5], [0.5, 1.0]]}] }"#;

pub(crate) const GRAPHML: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<graphml xmlns="http://graphml.graphdrawing.org/xmlns/graphml">
<key id="Type" for="edge"><default>requirement</default></key>
<graph edgedefault="directed">
<data key="NetworkType">STNU</data>
<data key="Name">kettle &amp; cup</data>
<node id="Z"><data key="x">1.0</data></node>
<node id="A"/><node id="C"/><node id="D"/><node id="X"/>
<edge id="1" source="A" target="C"><data key="Type">contingent</data><data key="Value">7</data></edge>
<edge id="2" source="C" target="A"><data key="Type">contingent</data><data key="Value">-3</data></edge>
<edge id="3" source="C" target="D"><data key="Type">contingent</data><data key="LabeledValue">LC(D):1</data></edge>
<edge id="4" source="D" target="C"><data key="Type">contingent</data><data key="LabeledValue">UC(D):-2</data></edge>
<edge id="5" source="D" target="X"><data key="Type">requirement</data><data key="Value">5</data></edge>
<edge id="6" source="X" target="D"><data key="Type">normal</data><data key="Value">-1</data></edge>
<edge id="7" source="X" target="A"><data key="Type">derived</data><data key="LabeledValue">UC(C): -7</data></edge>
</graph></graphml>"#;

pub(crate) const PLAIN: &str = "# KIND OF NETWORK
STNU
# Num Time-Points
3
# Num Ordinary Edges
2
# Num Contingent Links
1
# Time-Point Names
'A' 'C' X
# Ordinary Edges
X 12.5 'C'
'C' -7 X
# Contingent Links
'A' 1 3 'C'
";

pub(crate) const DIMACS: &str = "c 3 vertex labels follow:
c <label>     1 job_start
c <label>     2 job_end
c <label>     3 z
p sp 3 4
a 1 2 inf
a 2 1 10
a 3 1 0
c <refine> 1 2 -5
";

pub(crate) const INEQUALITIES: &str = r#"{"0": [[0, 1, 10.0], [1, 0, -0.0]], "1": [[0, 1, 10.0], [1, 0, -0.0], [2, 1, -3]], "2": [[2, 1, -3]]}"#;

pub(crate) const ELBOWROOM: &str = r#"{ "format": "elbowroom-network", "version": 1,
  "name": "tea", "reference": "begin",
  "points": ["begin", "boiled", "cut", "drunk"],
  "requirements": [{"from": "boiled", "to": "drunk", "lower": "1/3", "upper": "inf"}],
  "links": [
    {"activation": "begin", "end": "boiled", "lower": 3, "upper": "9/2",
     "duration": {"gamma": {"from": 3, "shape": 2, "scale": "1/4"}}},
    {"activation": "begin", "end": "cut", "lower": 0, "upper": "inf"}],
  "waits": [{"point": "drunk", "until": "boiled", "delay": 4}] }"#;

/// All samples, with typical file names.
pub(crate) const ALL: [(&str, &str); 7] = [
    ("one.json", HEATLAB),
    ("two.json", PSTN_LIB),
    ("three.stnu", GRAPHML),
    ("four.plainstnu", PLAIN),
    ("five.txt", DIMACS),
    ("six.json", INEQUALITIES),
    ("seven.json", ELBOWROOM),
];
