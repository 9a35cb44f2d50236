"""Reads an MCAP file with the format's own Python library, and compares it with the run that it was made of.

    python mcap_file.py RUN.jsonl RUN.mcap

Wants `mcap` from PyPI.
"""

import json
import sys

from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

lines = [json.loads(line) for line in open(sys.argv[1], encoding="utf-8")]
over = lines[-1]
records = list(StreamReader(open(sys.argv[2], "rb"), validate_crcs=True).records)
kinds = [type(record).__name__ for record in records]
assert kinds[0] == "Header" and kinds[-2:] == ["DataEnd", "Footer"], kinds
topics = {}
for schema, channel, message in make_reader(open(sys.argv[2], "rb")).iter_messages(log_time_order=True):
    assert schema.encoding == "jsonschema" and json.loads(schema.data)["type"] == "object"
    members = json.loads(schema.data)["properties"]
    data = json.loads(message.data)
    assert set(data) <= set(members), (channel.topic, data)
    topics.setdefault(channel.topic, []).append((message.log_time, data))
log = [data for _, data in topics["/elbowroom/log"]]
assert sum(it["name"] == "decision" for it in log) == sum(line["event"] == "decided" for line in lines)
started = set()
for topic, messages in topics.items():
    if topic.startswith("/elbowroom/lanes/"):
        for time, data in messages:
            started |= {(name, time) for name in data["action"].split(", ") if name}
for done in over["executed"]:
    time = round(done["start"]["decimal"] * 1e9)
    assert any(name == done["action"] and abs(at - time) < 1000 for name, at in started), done
print(f"{len(topics)} topics, {sum(map(len, topics.values()))} messages")
