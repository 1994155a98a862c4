"""Hostile descriptions and meshes by name, and unusual ones that are fine."""

from __future__ import annotations

import codecs
from collections.abc import Callable

from softrobots.core.xml_input import DEEPEST, LARGEST_FILE, MOST_ATTRIBUTES, MOST_TAGS
from softrobots.description.readers.mjcf_limits import MOST_ELEMENTS
from softrobots.description.urdf_structure import MOST_LINKS
from tests.support.foreign import BRANCHED, INERTIAL
from tests.support.hostile_descriptions import SDF, XACRO, dae, obj, stl


def chain(links: int, more: str = "") -> str:
    """URDF: links that hang on each other by fixed joints."""
    parts = [f'<link name="l{i}">{INERTIAL}</link>' + fixed(f"l{i - 1}", f"l{i}", f"j{i}") for i in range(1, links)]
    return f'<robot name="r"><link name="l0"/>{"".join(parts)}{more}</robot>'


def mjcf(body: str = "", before: str = "", asset: str = "") -> str:
    """MJCF: a sprung body."""
    return (
        f"<mujoco>{before}<asset>{asset}</asset><worldbody><body name='a'><joint name='j' stiffness='1'/><geom size='.1'/>"
        f"{body}</body></worldbody></mujoco>"
    )


def sdf(inside: str = "", link: str = "") -> str:
    """SDF: a link on the world."""
    inertial = "<inertial><mass>1</mass></inertial>"
    world = "<joint name='w' type='fixed'><parent>world</parent><child>a</child></joint>"
    return f"<sdf version='1.9'><model name='m'><link name='a'>{inertial}{link}</link>{world}{inside}</model></sdf>"


def fixed(parent: str, child: str, name: str = "x") -> str:
    return f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'


ROBOT = '<robot name="r"><link name="a"/>%s</robot>'
_ENTITIES = [f"<!ENTITY {new} '{f'&{old};' * 10}'>" for old, new in zip("abcdefghi", "bcdefghij", strict=True)]
BOMB = f"<!DOCTYPE r [<!ENTITY a 'aaaaaaaaaa'>{''.join(_ENTITIES)}]>"
OUTSIDE = '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
Content = str | bytes
# Reader, content, and what the refusal says. Each of these ended the process, hung, filled the memory or was read as another
# robot before it was refused, or would in a parser that is less careful.
REFUSED: dict[str, tuple[str, Content | Callable[[], Content], str]] = {
    # One door for all XML
    "bomb": ("URDF", BOMB + ROBOT % "&j;", "document type or entities"),
    "bomb in UTF-16": ("URDF", (BOMB + ROBOT % "&j;").encode("utf-16"), "document type or entities"),
    "bomb in MJCF": ("MJCF", BOMB + mjcf("&j;"), "document type or entities"),
    "bomb in SDF": ("SDF", BOMB + sdf("&j;"), "document type or entities"),
    "bomb in xacro": ("xacro", BOMB + XACRO, "document type or entities"),
    "other file": ("URDF", OUTSIDE + ROBOT % "&x;", "document type or entities"),
    "document type elsewhere": ("URDF", '<!DOCTYPE r SYSTEM "http://127.0.0.1:9/r.dtd">' + ROBOT % "", "document type"),
    "entity that nobody declares": ("URDF", ROBOT % "&lol;", "not well-formed"),
    "large": ("URDF", lambda: ROBOT % f"<!--{' ' * LARGEST_FILE}-->", f"more than {LARGEST_FILE} bytes"),
    "many tags": ("URDF", lambda: ROBOT % ("<a/>" * (MOST_TAGS + 1)), f"tags; at most {MOST_TAGS} are read"),
    "many attributes": (
        "URDF",
        lambda: ROBOT % "<a {}/>".format(" ".join(f"b{i}='1'" for i in range(100_000))),
        f"more than {MOST_ATTRIBUTES} attributes",
    ),
    "deep": ("URDF", lambda: ROBOT % ("<a>" * 15_000 + "</a>" * 15_000), f"more than {DEEPEST} deep"),
    "deep MJCF": ("MJCF", lambda: mjcf("<body>" * 15_000 + "</body>" * 15_000), f"more than {DEEPEST} deep"),
    "deep SDF": ("SDF", lambda: sdf("<model>" * 15_000 + "</model>" * 15_000), f"more than {DEEPEST} deep"),
    "deep xacro": ("xacro", lambda: XACRO.replace("<link", "<a>" * 500 + "</a>" * 500 + "<link"), f"more than {DEEPEST} deep"),
    "mesh tags without end in a comment": ("URDF", lambda: ROBOT % f"<!--{'<mesh' * 39_000}--><b>", "not well-formed"),
    "NUL": ("URDF", (ROBOT % "").replace('"a"', '"a\0"'), "not well-formed"),
    "bytes that are no UTF-8": ("URDF", (ROBOT % "").encode().replace(b'"a"', b'"\xe4"'), "'utf-8' codec"),
    "UTF-16 without a mark": ("URDF", (ROBOT % "").encode("utf-16-le"), "NUL characters"),
    "an encoding that is none": ("URDF", f'<?xml version="1.0" encoding="zip"?>{ROBOT % ""}', "declares the encoding 'zip'"),
    "UTF-7": ("URDF", f'<?xml version="1.0" encoding="utf-7"?>{ROBOT % ""}', "declares the encoding 'utf-7'"),
    "twice the same attribute": ("URDF", ROBOT % '<link name="b" name="c"/>', "not well-formed"),
    "undeclared prefix": ("URDF", ROBOT % '<softrobots:tip link="a"/>', "not well-formed"),
    "nothing": ("URDF", b"", "not well-formed"),
    # URDF: what Pinocchio's parser takes for something else
    "long chain": ("URDF", lambda: chain(MOST_LINKS + 1), f"at most {MOST_LINKS} are read"),
    "circle": (
        "URDF",
        ROBOT % ('<link name="b"/><link name="c"/>' + fixed("b", "c") + fixed("c", "b", "y")),
        "in a circle: b, c",
    ),
    "circle of one": ("URDF", ROBOT % ('<link name="b"/>' + fixed("b", "b")), "in a circle: b"),
    "two parents": (
        "URDF",
        ROBOT % ('<link name="b"/>' + fixed("a", "b") + fixed("a", "b", "y")),
        "hangs on two joints, x and y",
    ),
    "two roots": ("URDF", ROBOT % '<link name="b"/>', r"2 root links \(a, b\)"),
    "no links": ("URDF", '<robot name="r"/>', "has no links"),
    "twice a link": ("URDF", ROBOT % '<link name="a"/>', "several that are called 'a'"),
    "twice a joint": ("URDF", BRANCHED.replace('"elbow"', '"wrist"'), "several that are called 'wrist'"),
    "no name": ("URDF", BRANCHED.replace('name="elbow"', 'name=""'), "a joint without a name"),
    "the world's name": ("URDF", BRANCHED.replace('"elbow"', '"universe"'), "Pinocchio's name of the world"),
    "link that is not there": ("URDF", BRANCHED.replace('parent link="lower"', 'parent link="z"'), "the parent z; one link"),
    "two parents of a joint": (
        "URDF",
        BRANCHED.replace('<parent link="lower"/>', '<parent link="lower"/><parent link="base"/>'),
        "the parent lower, base",
    ),
    "axis without direction": ("URDF", BRANCHED.replace('"0 0 1"', '"0 0 0"'), "the axis 0 0 0, which has no direction"),
    "negative mass": ("URDF", BRANCHED.replace('value="0.5"', 'value="-0.5"'), "the mass -0.5; it is negative"),
    "spring on a joint that mimics itself": (
        "URDF text",
        BRANCHED.replace("<limit", '<mimic joint="elbow"/><limit'),
        r"mimic others \(elbow, wrist",
    ),
    "unexpanded xacro": ("URDF", XACRO, "unexpanded xacro"),
    # MJCF: what MuJoCo would do for a short file
    "replicas": ("MJCF", mjcf('<replicate count="100000000"><geom size=".1"/></replicate>'), "replicate count"),
    "replicas of replicas": (
        "MJCF",
        mjcf('<replicate count="999"><replicate count="999"><geom size=".1"/></replicate></replicate>'),
        f"{MOST_ELEMENTS}",
    ),
    "replicas of none": ("MJCF", mjcf('<replicate count="nan"/>'), "replicate count"),
    "mesh": ("MJCF", mjcf(asset='<mesh name="m" builtin="supersphere" params="10000 1 1"/>'), "params="),
    "texture": ("MJCF", mjcf(asset='<texture name="t" builtin="flat" width="99999" height="99999"/>'), "<texture width="),
    "height field": ("MJCF", mjcf(asset='<hfield name="h" nrow="99999" ncol="99999" size="1 1 1 1"/>'), "<hfield nrow="),
    "keys": ("MJCF", mjcf(before='<size nkey="2000000000"/>'), "<size nkey="),
    "memory": ("MJCF", mjcf(before='<size memory="900G"/>'), "<size memory="),
    "rays": ("MJCF", mjcf('<camera name="c" resolution="100000 100000"/>'), "<camera resolution="),
    "delays": ("MJCF", mjcf(before='<actuator><motor joint="j" nsample="1e9"/></actuator>'), "<motor nsample="),
    "grid": ("MJCF", mjcf('<flexcomp type="grid" count="3000 3000 3000" name="f"/>'), "<flexcomp count="),
    "simulation": ("MJCF", mjcf(before='<compiler><lengthrange timestep="1e-9"/></compiler>'), "<lengthrange timestep="),
    "many geoms": ("MJCF", lambda: mjcf("<geom size='.1'/>" * (MOST_ELEMENTS + 1)), f"more than {MOST_ELEMENTS} elements"),
    "class that is a format": ("MJCF", mjcf('<geom size=".1" class="%s%n"/>'), "<geom class='%s%n'>, which MuJoCo may use"),
    "class that spells a format": ("MJCF", mjcf('<geom size=".1" class="&#37;n"/>'), "<geom class='%n'>"),
    "axis whose length overflows": (
        "MJCF",
        mjcf('<body name="b"><joint name="k" axis="-1e300 1 0"/><geom size=".1"/></body>'),
        r"joint k has the axis \[-?0\.0, 0\.0, 0\.0\]; a direction",
    ),
    "reference without end": (
        "MJCF",
        mjcf('<body name="b"><joint name="k" axis="0 1 0" ref="-Infinity"/><geom size=".1"/></body>'),
        "joint k has ref = -inf",
    ),
    "included 90 MB": ("MJCF", mjcf(before='<include file="large.xml"/>'), "cannot read .*large.xml"),
    "included device": ("MJCF", mjcf(before='<include file="/dev/zero"/>'), "not below the folder"),
    "included folder above": ("MJCF", mjcf(before='<include file="../a.xml"/>'), "not below the folder"),
    "included itself": ("MJCF", mjcf(before='<include file="included itself.xml"/>'), "included twice, or in a circle"),
    "included bomb": ("MJCF", mjcf(before='<include file="bomb.xml"/>'), "document type or entities"),
    "included pipe": ("MJCF", mjcf(before='<include file="pipe.xml"/>'), "not well-formed|cannot read|refuses"),
    "model of itself": (
        "MJCF",
        mjcf('<attach model="m" body="a" prefix="p"/>', asset='<model name="m" file="model of itself.xml"/>'),
        "contains itself",
    ),
    "models of models": (
        "MJCF",
        mjcf('<attach model="m" body="a" prefix="p"/>' * 200, asset='<model name="m" file="hundreds.xml"/>'),
        f"{MOST_ELEMENTS}",
    ),
    "mesh from a pipe": ("MJCF", mjcf(asset='<mesh name="m" file="pipe.stl"/>'), "a folder, a device or a pipe"),
    "mesh from a device": ("MJCF", mjcf(asset='<mesh name="m" file="/dev/zero"/>'), "a folder, a device or a pipe"),
    "mesh in a folder": (
        "MJCF",
        mjcf(before='<compiler meshdir="/dev"/>', asset='<mesh file="zero"/>'),
        "a folder, a device or a pipe",
    ),
    "picture": ("MJCF", mjcf(asset='<texture name="t" type="2d" file="huge.png"/>'), "100000 x 100000 pixels"),
    "MJCF in Latin-1": (
        "MJCF",
        f'<?xml version="1.0" encoding="latin-1"?>{mjcf()}'.replace("'a'", "'\xe4'").encode("latin-1"),
        "not in UTF-8",
    ),
    "number of MJCF that is none": ("MJCF", mjcf('<geom size="nan"/>'), "MuJoCo .* refuses"),
    # SDF: where Drake ends the process, or raises what it should not
    "version": ("SDF", sdf().replace("1.9", "nan"), "Drake refuses .*"),
    "stiffness": ("SDF", SDF.replace(">20<", ">-20<"), "stiffness -20"),
    "limit": ("SDF", SDF.replace("<lower>-1<", "<lower>nan<"), "a NaN in joint j"),
    "many links": ("SDF", lambda: sdf("<link name='b'/>" * (MOST_LINKS + 1)), f"at most {MOST_LINKS} are read"),
    "included model": ("SDF", sdf("<include><uri>model://x</uri></include>"), "included files"),
    # MuJoCo doubles such a sensor with every copy
    "doubled sensors": (
        "MJCF",
        '<mujoco><worldbody><body name="b"><joint/><geom size=".1"/><replicate count="20" offset=".1 0 0"><geom size=".1"/>'
        "</replicate></body></worldbody><sensor><clock/></sensor></mujoco>",
        "sensors without an object",
    ),
    # xacro
    "macro of itself": (
        "xacro",
        XACRO.replace("<xacro:insert_block", '<xacro:part n="1" p="b"><a/></xacro:part><xacro:insert_block'),
        "refuses",
    ),
    "xacro that includes itself": (
        "xacro",
        XACRO.replace("<link", '<xacro:include filename="xacro that includes itself.xacro"/><link', 1),
        "refuses",
    ),
    "xacro that includes a device": (
        "xacro",
        XACRO.replace("<link", '<xacro:include filename="/dev/zero"/><link', 1),
        "more than",
    ),
    "xacro that includes a pipe": (
        "xacro",
        XACRO.replace("<link", '<xacro:include filename="pipe.xml"/><link', 1),
        "not well-formed",
    ),
    "xacro that includes a bomb": (
        "xacro",
        XACRO.replace("<link", '<xacro:include filename="bomb.xml"/><link', 1),
        "document type",
    ),
    # Meshes: left out of a drawing with a warning
    "faces": ("STL", stl()[0][:80] + b"\xff\xff\xff\xff" + stl()[0][84:], "cannot be read"),
    "corner that is no number": ("OBJ", obj()[0].replace(b"v 1 0 0", b"v nan 0 0"), "cannot be read"),
    "corner that is not there": ("OBJ", obj()[0].replace(b"f 1 3 2", b"f 1 3 999999999"), "cannot be read"),
    "corners without positions": ("DAE", dae()[0].replace(b'"POSITION"', b'"Z"'), "cannot be read"),
    "COLLADA bomb": ("DAE", dae()[0].replace(b"<COLLADA", BOMB.encode() + b"<COLLADA"), "cannot be read"),
    "index that is none": ("DAE", dae()[0].replace(b"1 0 1 3", b"1 0 nan 3"), "cannot be read"),
}
VALID: dict[str, tuple[str, Content | Callable[[], Content]]] = {
    "plain": ("URDF", chain(2)),
    "plain MJCF": ("MJCF", mjcf()),
    "plain SDF": ("SDF", SDF),
    "plain xacro": ("xacro", XACRO),
    "plain STL": ("STL", stl()[0]),
    "plain OBJ": ("OBJ", obj()[0]),
    "plain COLLADA": ("DAE", dae()[0]),
    "byte order mark": ("URDF", codecs.BOM_UTF8 + BRANCHED.encode()),
    "UTF-16": ("URDF", chain(3).encode("utf-16")),
    "UTF-32": ("URDF", chain(3).encode("utf-32")),
    "Latin-1": ("URDF", f'<?xml version="1.0" encoding="ISO-8859-1"?>{BRANCHED}'.replace("elbow", "\xe4").encode("latin-1")),
    "chain": ("URDF", lambda: chain(MOST_LINKS)),
    "mesh device in SDF": (
        "SDF",
        sdf(link="<collision name='c'><geometry><mesh><uri>/dev/zero</uri></mesh></geometry></collision>"),
    ),
    "plane without direction": (
        "SDF",
        sdf(link="<visual name='v'><geometry><plane><normal>0 0 0</normal></plane></geometry></visual>"),
    ),
    "package of Drake's": (
        "SDF",
        sdf(link="<visual name='v'><geometry><mesh><uri>package://drake_models/a.obj</uri></mesh></geometry></visual>"),
    ),
    "bodies in MJCF": ("MJCF", lambda: mjcf("<body><geom size='.1'/>" * 200 + "</body>" * 200)),
}
