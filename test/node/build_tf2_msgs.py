"""Builds tf2_msgs/TFMessage with the rosidl generators' wheels. Usage: build_tf2_msgs.py FOLDER

FOLDER/tf2_msgs becomes the Python package, FOLDER/lib holds the type supports that it loads. Needs
gcc, g++ and Python's headers. tf2_msgs itself has no wheel.
"""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

NAME = "tf2_msgs"
IDL = """
#include "geometry_msgs/msg/TransformStamped.idl"
module tf2_msgs { module msg { struct TFMessage {
  sequence<geometry_msgs::msg::TransformStamped> transforms;
}; }; };
"""
PREFIX = Path(sys.prefix)
STRUCTURE, DISPATCH = "rosidl_generator_c", "rosidl_typesupport_c"
KINDS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")


def generate(folder: Path) -> None:
    """Write the sources: C structure, type supports, Python class."""
    os.environ["AMENT_PREFIX_PATH"] = str(PREFIX)
    from rosidl_generator_c.cli import GenerateC
    from rosidl_generator_py.cli import GeneratePython
    from rosidl_typesupport_c.cli import GenerateCTypesupport
    from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
    from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

    (folder / "idl" / "msg").mkdir(parents=True)
    (folder / "idl" / "msg" / "TFMessage.idl").write_text(IDL)
    generators = {
        STRUCTURE: GenerateC(STRUCTURE),
        KINDS[0]: GenerateFastRTPSCTypesupport(KINDS[0]),
        KINDS[1]: GenerateIntrospectionCTypesupport(KINDS[1]),
        DISPATCH: GenerateCTypesupport(DISPATCH, typesupport_implementations=list(KINDS)),
        "": GeneratePython("py", typesupport_implementations=[DISPATCH]),
    }
    known = [str(PREFIX / "share" / n) for n in ("geometry_msgs", "std_msgs", "builtin_interfaces")]
    for kind, generator in generators.items():
        generator.generate(NAME, [f"{folder}/idl:msg/TFMessage.idl"], known, folder / kind / NAME)
    (folder / NAME / "__init__.py").touch()


def build(folder: Path) -> None:
    """Compile the shared libraries, one a type support, and Python's extension module."""
    import numpy as np

    folders = [PREFIX / "include", *(PREFIX / "include").iterdir()]
    folders += [folder / kind for kind in (STRUCTURE, *KINDS)]
    folders += [Path(sysconfig.get_path("include")), Path(np.get_include())]
    (folder / "lib").mkdir()
    libraries: list[str] = []
    for kind in (STRUCTURE, *KINDS, DISPATCH):
        target = folder / "lib" / f"lib{NAME}__{kind}.so"
        link(target, folder / kind, folders, [*libraries, f"geometry_msgs__{kind}"])
        libraries.append(f"{NAME}__{kind}")
    target = folder / NAME / f"{NAME}_s__{DISPATCH}.so"
    link(target, folder / NAME, folders, [*libraries, "geometry_msgs__rosidl_generator_py"])


def link(target: Path, sources: Path, folders: list[Path], libraries: list[str]) -> None:
    """Compile all sources in a folder to a shared library."""
    files = [str(path) for end in ("c", "cpp") for path in sources.rglob(f"*.{end}")]
    places = [target.parent.parent / "lib", PREFIX / "lib"]
    subprocess.run(
        ["g++" if any(file.endswith(".cpp") for file in files) else "gcc"]
        + ["-shared", "-O0", "-fPIC", "-w", f'-DROS_PACKAGE_NAME="{NAME}"', "-o", str(target)]
        + [*files, *(f"-I{path}" for path in folders)]
        + [f"-L{path}" for path in places]
        + [f"-Wl,-soname,{target.name}", *(f"-Wl,-rpath,{path}" for path in places)]
        + [f"-l{name}" for name in (*libraries, *KINDS, DISPATCH)]
        + ["-lrosidl_typesupport_fastrtps_cpp", "-lrosidl_runtime_c", "-lrcutils", "-lfastcdr"],
        check=True,
    )


if __name__ == "__main__":
    generate(Path(sys.argv[1]))
    build(Path(sys.argv[1]))
