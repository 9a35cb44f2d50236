"""A client on Cyclone DDS with the request format of `rmw_cyclonedds`.

Each request begins with the id of the client and the sequence number. The client accepts the replies that begin with the
same values.

`cyclone.py DOMAIN PROBLEM` requests the state of the executor, a plan, and a plan for half a domain, and prints the
answers as a JSON document.
"""

import json
import os
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import float32, int64, sequence, uint8, uint64
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

# Time limit of each wait, in seconds. Only a hanging process reaches it.
PATIENCE = 120
QOS = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(10), Policy.Durability.Volatile)


@dataclass
@final
class StateRequest(IdlStruct, typename="lifecycle_msgs::srv::dds_::GetState_Request_"):
    guid: uint64
    seq: int64
    structure_needs_at_least_one_member: uint8


@dataclass
@final
class StateResponse(IdlStruct, typename="lifecycle_msgs::srv::dds_::GetState_Response_"):
    guid: uint64
    seq: int64
    id: uint8
    label: str


@dataclass
@final
class PlanRequest(IdlStruct, typename="plansys2_msgs::srv::dds_::GetPlan_Request_"):
    guid: uint64
    seq: int64
    domain: str
    problem: str


@dataclass
@final
class PlanItem(IdlStruct, typename="plansys2_msgs::msg::dds_::PlanItem_"):
    time: float32
    action: str
    duration: float32


@dataclass
@final
class PlanResponse(IdlStruct, typename="plansys2_msgs::srv::dds_::GetPlan_Response_"):
    guid: uint64
    seq: int64
    success: bool
    items: sequence[PlanItem]
    error_info: str


class Client:
    def __init__(self, participant, name, request, response):
        self.name, self.request, self.number = name, request, 0
        self.writer = DataWriter(participant, Topic(participant, f"rq/{name}Request", request, QOS), QOS)
        self.reader = DataReader(participant, Topic(participant, f"rr/{name}Reply", response, QOS), QOS)
        self.guid = int(self.writer.guid) & (2**64 - 1)

    def wait(self):
        self.until(lambda: self.writer.get_matched_subscriptions() and self.reader.get_matched_publications(), "to be there")

    def call(self, **request):
        self.number += 1
        self.writer.write(self.request(guid=self.guid, seq=self.number, **request))
        answers = []

        def heard():
            # A sample without content reports a writer that has left.
            answers.extend(it for it in self.reader.take(10) if not isinstance(it, InvalidSample))
            return [it for it in answers if (it.guid, it.seq) == (self.guid, self.number)]

        (answer,) = self.until(heard, "an answer")
        return answer

    def until(self, holds, what):
        until = time.monotonic() + PATIENCE
        while not (found := holds()):
            assert time.monotonic() < until, f"{self.name}: waited in vain for {what}"
            time.sleep(0.05)
        return found


def main():
    participant = DomainParticipant(int(os.environ.get("ROS_DOMAIN_ID", "0")))
    state = Client(participant, "executor/get_state", StateRequest, StateResponse)
    plan = Client(participant, "planner/get_plan", PlanRequest, PlanResponse)
    domain, problem = (open(it, encoding="utf-8").read() for it in sys.argv[1:3])
    for client in (state, plan):
        client.wait()
    said = {"state": state.call(structure_needs_at_least_one_member=0).label}
    answer = plan.call(domain=domain, problem=problem)
    said["planned"] = [answer.success, [[it.time, it.action, it.duration] for it in answer.items]]
    broken = plan.call(domain="(define (domain", problem=problem)
    said["broken"] = [broken.success, broken.error_info]
    print(json.dumps(said), flush=True)


if __name__ == "__main__":
    main()
