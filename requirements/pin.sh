#!/bin/sh
# Print the versions that an environment holds, as lock.txt wants them. Usage: pin.sh PYTHON VENV
set -eu
echo "# Every package of $2, pinned (x86-64 Linux, Python 3.11 to 3.14). Remake: make lock"
# A ROS wheel brings the Python package it holds along as a second distribution (rclpy beside
# ros-rclpy) that no index has: a pin of that name is left out.
"$1" -m pip list --format=freeze --disable-pip-version-check | sort -f | awk -F== '
    { line[NR] = $0; name[NR] = $1; seen[$1] = 1 }
    END {
        for (i = 1; i <= NR; i++) {
            dashed = "ros-" name[i]; gsub("_", "-", dashed)
            if (name[i] == "pip" || dashed in seen) continue
            older = name[i] == "backports.zstd" || name[i] == "opensim"
            print line[i] (older ? " ; python_version < \"3.14\"" : "")
        }
    }'
