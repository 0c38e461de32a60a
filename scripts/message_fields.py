"""Numbers out of ROS messages of any type, and how a script hands them to the program that started it.

A path is a topic and behind it the way to one number in its messages: /TOPIC/FIELD/FIELD. FIELD[3] is an element of an
array, counted from 0. FIELD[NAME] is the element that is called NAME: the array stands beside an array `name` of texts
(as in sensor_msgs/JointState), or its elements have a field `name`.

Records on standard output, little-endian: int64 field, int64 stamp (ns since 1970), float64 value. A negative field is
the kind of a text that follows, `stamp` bytes long: -1 an error in one line, -2 the end of what there was, -3 a note.
"""

import difflib
import re
import struct

ERROR, END, NOTE = -1, -2, -3
RECORD = struct.Struct("<qqd")
STEP = re.compile(r"([A-Za-z]\w*)(?:\[([^\[\]]+)\])?")


class FieldError(Exception):
    """The path leads to no number, whatever messages come."""


class Absent(Exception):
    """This message has no such element of an array; another one may."""


def one_line(problem):
    return " ".join(str(problem).split()) or type(problem).__name__


def did_you_mean(word, names):
    near = difflib.get_close_matches(word, list(names), 1)
    return f"; did you mean '{near[0]}'?" if near else ""


def listed(names):
    names = list(names)
    return ", ".join(names[:12]) + (", ..." if len(names) > 12 else "") if names else "none"


def topic_of(path, topics):
    """The longest of the topics that begins the path; None: there is none. A name in brackets may hold a /."""
    bare = path.split("[", 1)[0]
    fitting = [topic for topic in topics if bare.startswith(topic + "/")]
    return max(fitting, key=len, default=None)


def unknown_topic(path, topics, where):
    """What to say of a path that no topic begins."""
    topics = sorted(topics)
    bare = path.split("[", 1)[0]
    if bare in topics:
        return f"{path}: this is a topic; name the field behind it, as in {path}/data"
    parts = bare.split("/")
    near = [did_you_mean("/".join(parts[:length]), topics) for length in range(len(parts) - 1, 1, -1)]
    return f"{path}: {where} has no such topic; there are {listed(topics)}" + next(filter(None, near), "")


class Field:
    """The way to one number, and the look-up of it in a message."""

    def __init__(self, path, topic):
        self.path, self.topic = path, topic
        self.steps, rest = [], path[len(topic) + 1 :]
        while rest:
            step = STEP.match(rest)
            if not step:
                raise FieldError(f"{path}: '{rest}' is no field; write FIELD, FIELD[3] or FIELD[NAME], with / between")
            self.steps.append(step.groups())
            rest = rest[step.end() :]
            if rest and rest[0] not in "/.":
                raise FieldError(f"{path}: '{rest}' is no field; write FIELD, FIELD[3] or FIELD[NAME], with / between")
            rest = rest[1:]

    def read(self, message):
        value = message
        for name, key in self.steps:
            holder = value
            if name not in getattr(holder, "__slots__", ()) or not hasattr(holder, "_slot_types"):
                raise FieldError(self.no_field(holder, name))
            value = getattr(holder, name)
            if key is not None:
                value = self.element(holder, name, value, key)
        if isinstance(value, (int, float)):
            return float(value)
        raise FieldError(self.no_number(holder, name, value))

    def element(self, holder, name, array, key):
        if not isinstance(array, (list, tuple, bytes)):
            raise FieldError(f"{self.path}: '{name}' is no array; leave [{key}] out")
        if key.isdigit():
            place = int(key)
        else:
            beside = getattr(holder, "name", None)
            if not isinstance(beside, (list, tuple)):
                beside = [getattr(entry, "name", None) for entry in array]
                if array and not isinstance(beside[0], str):
                    raise FieldError(f"{self.path}: '{name}' has no names; count its elements, as in {name}[0]")
            if key not in beside:
                near = did_you_mean(key, beside)
                raise Absent(f"{self.path}: no element is called '{key}'; there are {listed(beside)}{near}")
            place = beside.index(key)
        if place >= len(array):
            raise Absent(f"{self.path}: '{name}' has {len(array)} elements, counted from 0")
        return array[place]

    def no_field(self, holder, name):
        kind = getattr(holder, "_type", None)
        if kind is None:
            return f"{self.path}: nothing stands behind the number or array before '{name}'; leave '{name}' out"
        names = getattr(holder, "__slots__", [])
        return f"{self.path}: {kind} has no field '{name}'; its fields are {listed(names)}{did_you_mean(name, names)}"

    def no_number(self, holder, name, value):
        kind = dict(zip(holder.__slots__, holder._slot_types))[name]
        if isinstance(value, (list, tuple, bytes)):
            names = getattr(holder, "name", ())
            by_name = f" or {name}[{names[0]}]" if isinstance(names, (list, tuple)) and names else ""
            return f"{self.path}: this is an array ({kind}); name an element, as in {name}[0]{by_name}"
        fields = getattr(value, "__slots__", ())
        more = f"; its fields are {listed(fields)}" if hasattr(value, "_type") else ""
        return f"{self.path}: this is a {kind}, not a number{more}"


def header_stamp(message):
    """ns since 1970; None where the message has no header, 0 where nobody set it."""
    if "header" not in message.__slots__:
        return None
    stamp = getattr(message.header, "stamp", None)
    return None if stamp is None else stamp.to_nsec()


class Clock:
    """Where a topic's time comes from: `header`, `receipt`, or `auto`: the header where its first message has a stamp
    there."""

    def __init__(self, topic, wanted):
        self.topic, self.source = topic, wanted

    def time(self, message, received):
        if self.source == "receipt":
            return received
        stamp = header_stamp(message)
        if self.source == "auto":
            self.source = "header" if stamp else "receipt"
            return stamp or received
        if stamp is None:
            raise FieldError(f"{self.topic}: {message._type} has no header; say time: receipt in the mapping")
        if stamp == 0:
            raise FieldError(f"{self.topic}: a message has no stamp in its header; say time: receipt in the mapping")
        return stamp


def text_record(kind, text):
    data = text.encode("utf-8", "replace")
    return RECORD.pack(kind, len(data), 0.0) + data
