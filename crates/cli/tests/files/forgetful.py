"""A world on the real clock that remembers nothing when it is started again, and in which actions never end."""

import json
import time

begun = time.monotonic()
news = []
while True:
    try:
        message = json.loads(input())
    except EOFError:
        break
    now = time.monotonic() - begun
    if message["type"] == "start":
        news.append({"type": "started", "ticket": message["ticket"], "time": now})
    elif message["type"] == "cancel":
        news.append({"type": "ended", "ticket": message["ticket"], "outcome": "cancelled", "time": now})
    elif message["type"] in ("look", "wait"):
        if message["type"] == "wait" and not news:
            time.sleep(max(0, min(message["until"]["decimal"] - now, 0.1)))
        for line in [*news, {"type": "time", "now": time.monotonic() - begun}]:
            print(json.dumps(line), flush=True)
        news = []
    elif message["type"] == "stop":
        break
