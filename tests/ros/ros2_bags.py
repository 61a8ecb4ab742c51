"""Bags of ROS 2, .db3 and .mcap, of messages of ROS 1 that have the same fields: for machines without ROS 2."""
import pathlib
import sqlite3
import struct
import zlib

from sensor_msgs.msg import CameraInfo, CompressedImage
from tf2_msgs.msg import TFMessage

MCAP_MAGIC = b"\x89MCAP0\r\n"
CHUNK_BYTES = 1_000_000


class Cdr:
    """ROS 2's bytes of a message of ROS 1 with the same fields."""

    def __init__(self):
        self.body = bytearray()

    def put(self, form, *values):
        for value in values:
            size = struct.calcsize(form)
            self.body += bytes(-len(self.body) % size) + struct.pack("<" + form, value)
        return self

    def text(self, text):
        self.put("I", len(text) + 1).body.extend(text.encode() + b"\0")
        return self

    def header(self, header):
        return self.put("i", header.stamp.secs).put("I", header.stamp.nsecs).text(header.frame_id)

    def pose(self, position, turn):
        return self.put("d", position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w)

    @staticmethod
    def of(message):
        cdr = Cdr()
        if isinstance(message, TFMessage):
            cdr.put("I", len(message.transforms))
            for link in message.transforms:
                cdr.header(link.header).text(link.child_frame_id)
                cdr.pose(link.transform.translation, link.transform.rotation)
        elif isinstance(message, CompressedImage):
            cdr.header(message.header).text(message.format).put("I", len(message.data)).body.extend(message.data)
        elif isinstance(message, CameraInfo):
            cdr.header(message.header).put("I", message.height, message.width).text(message.distortion_model)
            cdr.put("I", len(message.D)).put("d", *message.D, *message.K, *message.R, *message.P)
            cdr.put("I", 0, 0, 0, 0, 0, 0).put("B", 0)
        else:
            cdr.header(message.header).text(message.child_frame_id)
            cdr.pose(message.pose.pose.position, message.pose.pose.orientation)
            cdr.put("d", *message.pose.covariance, *[0] * 6, *message.twist.covariance)
        return b"\0\1\0\0" + bytes(cdr.body)


def type_of(message):
    return message._type.replace("/", "/msg/")


def write_db3(path, messages):
    """(topic, message, time in ns) each."""
    pathlib.Path(path).unlink(missing_ok=True)
    database = sqlite3.connect(path)
    database.executescript(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);")
    numbers = {}
    for topic, message, time_ns in messages:
        if topic not in numbers:
            numbers[topic] = len(numbers) + 1
            database.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", (numbers[topic], topic, type_of(message)))
        database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
                         (numbers[topic], time_ns, Cdr.of(message)))
    database.commit()
    database.close()


def mcap_text(text):
    return struct.pack("<I", len(text)) + text.encode()


def mcap_record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def write_mcap(path, messages):
    """(topic, message, time in ns) each; chunks without compression, no summary: as a recorder that was killed leaves it."""
    numbers = {}
    with open(path, "wb") as file:
        file.write(MCAP_MAGIC + mcap_record(1, mcap_text("ros2") + mcap_text("cairn's tests")))
        chunk = bytearray()

        def end_chunk():
            if chunk:
                file.write(mcap_record(6, struct.pack("<QQQI", 0, 0, len(chunk), zlib.crc32(chunk)) + mcap_text("")
                                       + struct.pack("<Q", len(chunk)) + chunk))
            chunk.clear()

        for topic, message, time_ns in messages:
            if topic not in numbers:
                number = numbers[topic] = len(numbers) + 1
                chunk += mcap_record(3, struct.pack("<H", number) + mcap_text(type_of(message)) + mcap_text("ros2msg") + mcap_text(""))
                chunk += mcap_record(4, struct.pack("<HH", number, number) + mcap_text(topic) + mcap_text("cdr") + struct.pack("<I", 0))
            chunk += mcap_record(5, struct.pack("<HIQQ", numbers[topic], 0, time_ns, time_ns) + Cdr.of(message))
            if len(chunk) > CHUNK_BYTES:
                end_chunk()
        end_chunk()
        file.write(mcap_record(15, struct.pack("<I", 0)) + mcap_record(2, struct.pack("<QQI", 0, 0, 0)) + MCAP_MAGIC)
