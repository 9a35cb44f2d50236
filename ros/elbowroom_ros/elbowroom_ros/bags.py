"""Reading of rosbag2 recordings (SQLite or MCAP): with rosbag2_py of ROS, or else with the package rosbags of PyPI."""

import os
from pathlib import Path


class BagError(Exception):
    """The recording cannot be read."""


def messages(path, types):
    """Returns the messages of these types as topic, type and serialized message, in the order of their reception."""
    if not os.path.exists(path):
        raise BagError(f"{path}: there is no such file")
    try:
        import rosbag2_py
    except ImportError:
        try:
            import rosbags  # noqa: F401
        except ImportError:
            raise BagError("neither rosbag2_py nor rosbags is installed") from None
        return with_rosbags(path, types)
    return with_rosbag2_py(rosbag2_py, path, types)


def with_rosbag2_py(rosbag2_py, path, types):
    reader = rosbag2_py.SequentialReader()
    try:
        reader.open(rosbag2_py.StorageOptions(uri=path), rosbag2_py.ConverterOptions("", ""))
    except RuntimeError as error:
        raise BagError(f"{path}: {error}") from None
    kinds = {it.name: it.type for it in reader.get_all_topics_and_types() if it.type in types}
    reader.set_filter(rosbag2_py.StorageFilter(topics=list(kinds)))
    while kinds and reader.has_next():
        topic, data, _ = reader.read_next()
        if topic in kinds:
            yield topic, kinds[topic], data


def with_rosbags(path, types):
    from rosbags.rosbag2 import Reader, ReaderError

    folder = Path(path)
    try:
        with Reader(folder if folder.is_dir() else folder.parent) as reader:
            connections = [it for it in reader.connections if it.msgtype in types]
            for connection, _, data in reader.messages(connections=connections) if connections else ():
                yield connection.topic, connection.msgtype, bytes(data)
    except ReaderError as error:
        raise BagError(f"{path}: {error}") from None
