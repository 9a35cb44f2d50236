"""Reads a trace with Perfetto's own Python bindings, and compares it with the run that it was made of.

    python perfetto_trace.py RUN.jsonl RUN.pftrace

Wants `perfetto` from PyPI.
"""

import json
import sys

from perfetto.protos.perfetto.trace.perfetto_trace_pb2 import Trace, TrackEvent

lines = [json.loads(line) for line in open(sys.argv[1], encoding="utf-8")]
over = lines[-1]
trace = Trace()
trace.ParseFromString(open(sys.argv[2], "rb").read())
assert all(packet.trusted_packet_sequence_id == 1 for packet in trace.packet)
tracks = {packet.track_descriptor.uuid: packet.track_descriptor for packet in trace.packet if packet.HasField("track_descriptor")}
events = [(packet.timestamp, packet.track_event) for packet in trace.packet if packet.HasField("track_event")]
assert events and all(event.track_uuid in tracks for _, event in events), "every event has its track"
assert all(not track.parent_uuid or track.parent_uuid in tracks for track in tracks.values())
times = [time for time, _ in events]
assert times == sorted(times), "in order of time"

# Slices open and close in turn: none overlaps another on its track.
open_slices, slices = {}, []
for time, event in events:
    track = event.track_uuid
    if event.type == TrackEvent.TYPE_SLICE_BEGIN:
        assert track not in open_slices, "slices on one track do not overlap"
        open_slices[track] = (time, event)
    elif event.type == TrackEvent.TYPE_SLICE_END:
        begun, first = open_slices.pop(track)
        slices.append((tracks[track].name, first.name, begun, time, first))
assert not open_slices, "every slice ends"

done = sorted((name, begun, end) for track, name, begun, end, _ in slices if track == "done")
nanoseconds = lambda number: round(number["decimal"] * 1e9)
expected = sorted(
    (it["action"], nanoseconds(it["start"]), nanoseconds({"decimal": it["start"]["decimal"] + it["duration"]["decimal"]}))
    for it in over["executed"] if it["duration"]
)
assert len(done) == len(expected), (done, expected)
for ours, theirs in zip(done, expected):
    assert ours[0] == theirs[0] and abs(ours[1] - theirs[1]) < 1000 and abs(ours[2] - theirs[2]) < 1000, (ours, theirs)
decisions = [event for _, event in events if tracks[event.track_uuid].name == "decisions"]
assert len(decisions) == sum(line["event"] == "decided" for line in lines)
leaving = sorted(flow for *_, event in slices for flow in event.flow_ids)
entering = sorted(flow for *_, event in slices for flow in event.terminating_flow_ids)
assert leaving == entering and leaving, "every ordering leaves one slice and ends at another"
print(f"{len(tracks)} tracks, {len(slices)} slices, {len(decisions)} decisions, {len(leaving)} flows")
