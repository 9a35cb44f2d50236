"""Recordings of an executive's topics, as rosbag2 writes them."""

from pathlib import Path

from elbowroom_msgs.msg import Event
from rclpy.serialization import deserialize_message

DEFINITION = "uint64 number\nstring line\n"


def events(raw):
    """Returns serialized messages as documents, each line of the trace once."""
    found = {}
    for _, data in raw:
        message = deserialize_message(data, Event)
        found[message.number] = {"number": message.number, "line": message.line}
    return [found[it] for it in sorted(found)]


def write(path, storage, raw, kind="elbowroom_msgs/msg/Event", definition=DEFINITION):
    """Writes serialized messages of one type to a bag: pairs of topic and data."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(definition, kind))
    plugin = StoragePlugin.SQLITE3 if storage == "sqlite3" else StoragePlugin.MCAP
    with Writer(Path(path), version=9, storage_plugin=plugin) as writer:
        topics = sorted({topic for topic, _ in raw})
        found = {it: writer.add_connection(it, kind, typestore=store) for it in topics}
        for at, (topic, data) in enumerate(raw):
            writer.write(found[topic], 1_000_000 * at, data)
