#!/usr/bin/env python3
"""Checks that includes follow the arrows between folders, and that libraries stay where they belong.

    clients -> proto <- server -> core -> proto        clients/cli, the composition root, may use everything
    core: engine -> {scene, tools, contact, effects, solve} -> model;  study -> core

With --self-test it checks itself: each planted violation must be found, each permitted include must pass.
"""

import re
import subprocess
import sys

# Folder -> folders whose headers it may include, besides its own. The longest matching folder decides. `None`: any.
PROTO = "proto"                # every generated header
PROTO_DATA = "proto:data"      # generated headers that are plain data: scenes and frames, no services
CORE_PARTS = ["core/scene", "core/tools", "core/contact", "core/effects", "core/solve"]
ALLOWED = {
    "core/model": [PROTO_DATA],
    "core/scene": ["core/model", PROTO_DATA],
    "core/tools": ["core/model", PROTO_DATA],
    "core/contact": ["core/model", PROTO_DATA],
    "core/effects": ["core/model", PROTO_DATA],
    "core/solve": ["core/model", PROTO_DATA],
    "core/engine": ["core/model", *CORE_PARTS, PROTO_DATA],
    "core/study": ["core/model", "core/engine", *CORE_PARTS, PROTO_DATA],
    # The server knows no physics: it asks the reader for a model and the engine for steps.
    "server": ["core/model", "core/scene", "core/engine", PROTO],
    "server/web": ["core/model", "server", PROTO],
    "server/recording": ["core/model", "core/scene", "core/engine", "server", PROTO],
    "clients": [PROTO],
    "clients/cli": None,
    "tests": None,
}

# Sources that put parts of their folder together, and what they may include besides.
COMPOSERS = {"server/server.cc": ["server/web"]}

DATA_MESSAGES = re.compile(r"^adhesim/v1/(options|scene|frame)\.pb\.h$")
GENERATED = re.compile(r"^(adhesim|google/rpc)/.*\.pb\.h$")
GRPC = re.compile(r"^(grpc|grpcpp|grpc\+\+)/|\.grpc\.pb\.h$")
BULLET = re.compile(r"^(bullet/|BulletCollision/|BulletDynamics/|BulletSoftBody/|LinearMath/|bt[A-Z]\w*\.h$)")
BOOST = re.compile(r"^boost/")
BEAST_HEADER = re.compile(r"^server/web/beast_\w+\.h$")    # headers that hold Boost types
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]')


def folder_of(path, folders):
    """The longest of `folders` that holds `path`, or None."""
    holders = [f for f in folders if path.startswith(f + "/")]
    return max(holders, key=len) if holders else None


def complaint(path, include):
    """What is wrong with `path` including `include`, or None."""
    own = folder_of(path, ALLOWED)
    if own is None or path.endswith("_test.cc"):   # a test beside what it tests may use everything
        return None
    in_core = path.startswith("core/")
    if GRPC.search(include) and (in_core or path.startswith(("server/recording/", "server/web/"))):
        return "gRPC is for the services and the clients only"
    in_web = (path.startswith("server/web/") and path.endswith(".cc")) or BEAST_HEADER.match(path)
    if (BOOST.match(include) or BEAST_HEADER.match(include)) and not in_web and not path.startswith("tests/"):
        return "Boost is included by server/web/*.cc and server/web/beast_*.h only"
    may_use_bullet = path.endswith(".cc") and path.startswith(("core/tools/", "clients/cli/bullet_"))
    if BULLET.match(include) and not may_use_bullet and not path.startswith("tests/"):
        return "Bullet is included by core/tools/*.cc and clients/cli/bullet_*.cc only"
    permitted = ALLOWED[own]
    if permitted is None:
        return None
    if GENERATED.match(include):
        if PROTO in permitted or (PROTO_DATA in permitted and DATA_MESSAGES.match(include)):
            return None
        return f"{own} may use no other messages than scenes and frames"
    target = folder_of(include, ALLOWED)
    if target is None or target == own or target in permitted or target in COMPOSERS.get(path, []):
        return None
    return f"{own} may include of this project only: {', '.join([own, *permitted])}"


def check(sources):
    """`sources`: pairs of path and text. Returns the violations as lines."""
    found = []
    for path, text in sources:
        for number, line in enumerate(text.splitlines(), 1):
            match = INCLUDE.match(line)
            problem = match and complaint(path, match.group(1))
            if problem:
                found.append(f"{path}:{number}: error: includes {match.group(1)}: {problem}")
    return found


def self_test():
    forbidden = [
        ("core/model/a.h", "core/solve/b.h"),
        ("core/model/a.h", "core/engine/engine.h"),
        ("core/scene/a.cc", "core/engine/engine.h"),
        ("core/contact/a.cc", "core/solve/b.h"),
        ("core/effects/drag/a.cc", "core/contact/b.h"),
        ("core/engine/a.cc", "server/session.h"),
        ("core/engine/a.cc", "clients/cli/commands.h"),
        ("core/engine/a.cc", "grpcpp/grpcpp.h"),
        ("core/engine/a.cc", "adhesim/v1/view_service.grpc.pb.h"),
        ("core/scene/a.cc", "adhesim/v1/session_service.pb.h"),
        ("core/solve/a.cc", "btBulletCollisionCommon.h"),
        ("core/tools/tool_set.h", "bullet/LinearMath/btVector3.h"),
        ("clients/cli/a.cc", "BulletCollision/CollisionShapes/btBoxShape.h"),
        ("clients/cli/bullet_tissue.h", "BulletSoftBody/btSoftBody.h"),
        ("server/session.cc", "core/contact/b.h"),
        ("server/recording/a.cc", "grpcpp/grpcpp.h"),
        ("server/web/web_server.cc", "grpcpp/grpcpp.h"),
        ("server/web/web_server.cc", "core/engine/engine.h"),
        ("server/web/web_server.h", "boost/asio/io_context.hpp"),
        ("server/web/web_server.h", "server/web/beast_connections.h"),
        ("server/server.cc", "boost/asio/io_context.hpp"),
        ("server/server.cc", "server/web/beast_connections.h"),
        ("server/hub.cc", "server/web/web_server.h"),
        ("clients/load/a.cc", "core/model/model.h"),
        ("clients/load/a.cc", "server/session.h"),
    ]
    permitted = [
        ("core/engine/a.cc", "core/solve/b.h"),
        ("core/scene/mesh/a.cc", "core/model/geometry.h"),
        ("core/scene/a.cc", "adhesim/v1/scene.pb.h"),
        ("core/tools/tool_set.cc", "BulletCollision/CollisionShapes/btBoxShape.h"),
        ("clients/cli/bullet_tissue.cc", "BulletSoftBody/btSoftBody.h"),
        ("server/session.cc", "core/engine/engine.h"),
        ("server/service.cc", "grpcpp/grpcpp.h"),
        ("server/web/web_server.cc", "boost/asio/io_context.hpp"),
        ("server/web/beast_connections.h", "boost/beast/websocket.hpp"),
        ("server/web/client_connection.h", "server/viewer_stream.h"),
        ("server/web/client_connection.h", "adhesim/v1/connection.pb.h"),
        ("server/server.cc", "server/web/web_server.h"),
        ("tests/server/web/a.h", "boost/beast/websocket.hpp"),
        ("clients/load/a.cc", "adhesim/v1/view_service.grpc.pb.h"),
        ("clients/cli/main.cc", "core/engine/engine.h"),
        ("tests/server/a.cc", "core/engine/engine.h"),
        ("core/solve/a.cc", "Eigen/Core"),
        ("core/effects/drag/drag_test.cc", "tests/support/b.h"),
    ]
    wrong = [f"not found: {p} includes {i}" for p, i in forbidden if not check([(p, f'#include "{i}"\n')])]
    wrong += check((p, f"  # include <{i}>\n") for p, i in permitted)
    return wrong


def repository_sources():
    names = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", "*.h", "*.cc"],
        check=True, capture_output=True, text=True).stdout.split("\0")
    for name in filter(None, names):
        with open(name, encoding="utf-8") as file:
            yield name, file.read()


def main():
    found = self_test() if sys.argv[1:] == ["--self-test"] else check(repository_sources())
    print("\n".join(found), end="\n" if found else "", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
