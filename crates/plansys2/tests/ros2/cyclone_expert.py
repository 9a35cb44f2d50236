"""`expert.py` on Cyclone DDS with the request format of `rmw_cyclonedds`: requests and replies begin with the id of the
client and the sequence number.
"""

import json
import os
import signal
import sys
import time
from dataclasses import dataclass, field

from cyclone import QOS
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import float64, int64, sequence, uint8, uint32, uint64
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from expert import CHANGES, FUNCTION, PREDICATE, Knowledge


@dataclass
@final
class Param(IdlStruct, typename="plansys2_msgs::msg::dds_::Param_"):
    name: str
    type: str = ""
    sub_types: sequence[str] = field(default_factory=list)


@dataclass
@final
class Node(IdlStruct, typename="plansys2_msgs::msg::dds_::Node_"):
    node_type: uint8
    expression_type: uint8
    modifier_type: uint8
    node_id: uint32
    children: sequence[uint32]
    name: str
    parameters: sequence[Param]
    value: float64
    negate: bool


@dataclass
@final
class StatesRequest(IdlStruct, typename="plansys2_msgs::srv::dds_::GetStates_Request_"):
    guid: uint64
    seq: int64
    structure_needs_at_least_one_member: uint8


@dataclass
@final
class StatesResponse(IdlStruct, typename="plansys2_msgs::srv::dds_::GetStates_Response_"):
    guid: uint64
    seq: int64
    success: bool
    states: sequence[Node]
    error_info: str


@dataclass
@final
class AffectRequest(IdlStruct, typename="plansys2_msgs::srv::dds_::AffectNode_Request_"):
    guid: uint64
    seq: int64
    node: Node


@dataclass
@final
class AffectResponse(IdlStruct, typename="plansys2_msgs::srv::dds_::AffectNode_Response_"):
    guid: uint64
    seq: int64
    success: bool
    error_info: str


@dataclass
@final
class Empty(IdlStruct, typename="std_msgs::msg::dds_::Empty_"):
    structure_needs_at_least_one_member: uint8 = 0


def node(words, kind, value=0.0):
    name, *parameters = words.split()
    return Node(kind, 0, 0, 0, [], name, [Param(it) for it in parameters], value, False)


class Expert:
    def __init__(self, spec, log):
        self.participant = DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", "0")))
        notify = DataWriter(self.participant, Topic(self.participant, "rt/problem_expert/update_notify", Empty, QOS), QOS)
        self.knowledge = Knowledge(spec, log, lambda: notify.write(Empty()))
        self.services = [
            self.service("get_problem_predicates", StatesRequest, StatesResponse, lambda _: self.states(
                [node(it, PREDICATE) for it in sorted(self.knowledge.facts)])),
            self.service("get_problem_functions", StatesRequest, StatesResponse, lambda _: self.states(
                [node(it, FUNCTION, value) for it, value in sorted(self.knowledge.numbers.items())])),
        ]  # fmt: skip
        for name in CHANGES:
            self.services.append(self.service(name, AffectRequest, AffectResponse, lambda it, name=name: self.affect(name, it)))

    def service(self, name, request, response, answer):
        there = self.participant
        reader = DataReader(there, Topic(there, f"rq/problem_expert/{name}Request", request, QOS), QOS)
        writer = DataWriter(there, Topic(there, f"rr/problem_expert/{name}Reply", response, QOS), QOS)
        return reader, lambda it: writer.write(response(guid=it.guid, seq=it.seq, **answer(it)))

    def states(self, states):
        return {"success": True, "states": states, "error_info": ""}

    def affect(self, name, request):
        is_done = self.knowledge.affect(name, request.node)
        return {"success": is_done, "error_info": "" if is_done else "it is not valid"}

    def serve(self):
        for reader, answer in self.services:
            for request in reader.take(10):
                # A sample without content reports a writer that has left.
                if not isinstance(request, InvalidSample):
                    answer(request)


def main():
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    with open(sys.argv[2], "w", encoding="utf-8") as log:
        expert = Expert(json.loads(sys.argv[1]), log)
        while True:
            expert.serve()
            time.sleep(0.02)


if __name__ == "__main__":
    main()
