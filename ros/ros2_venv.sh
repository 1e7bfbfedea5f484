#!/usr/bin/env bash
# A virtual environment with a real rclpy and usv_gym_msgs compiled into it, without a ROS installation.
# usage: ros/ros2_venv.sh VENV [PYTHON]
#   VENV    where to make it.  Keep it apart from others: its wheels start every python in it anew to find their libraries.
#   PYTHON  an interpreter whose environment has usv_gym; its packages then stand behind those of VENV, so that
#           `VENV/bin/usv-gym hil ..` works.  It must be of the same version, with the same NumPy.
# Needs: python3.11 with its headers, a C and C++ compiler.
set -euo pipefail
venv="$1" python="${2:-}" here="$(cd "$(dirname "$0")" && pwd)"
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH
python3.11 -m venv "$venv"
venv="$(cd "$venv" && pwd)" py="$venv/bin/python"
numpy=numpy
[ -n "$python" ] && numpy="numpy==$("$python" -c 'import numpy; print(numpy.__version__)')"
"$py" -m pip install -q --disable-pip-version-check \
    "$numpy" setuptools catkin_pkg cmake==3.31.6 ninja==1.13.0 \
    ros-kilted-rclpy==9.1.2 ros-kilted-rmw-fastrtps-cpp==9.3.3 ros-kilted-common-interfaces==5.5.1 \
    ros-kilted-ament-cmake==2.7.3 ros-kilted-ament-package ros-kilted-ament-cmake-include-directories==2.7.3 \
    ros-kilted-ament-cmake-ros-core==0.14.5 ros-kilted-ament-cmake-ros==0.14.5 \
    ros-kilted-rosidl-default-generators==1.7.1 ros-kilted-rosidl-core-generators==0.3.1
# the wheels' cmake targets name the include directories of the machine that built them
include="$("$py" -c 'import sysconfig; print(sysconfig.get_paths()["include"])')"
arrays="$("$py" -c 'import numpy; print(numpy.get_include())')"
{ grep -rlE '/opt/python/cp3' "$venv"/share/*/cmake || true; } | xargs -r sed -i -E \
    "s#/opt/python/cp3[0-9]+-cp3[0-9]+/lib/python3\.[0-9]+/site-packages/numpy/_core/include#$arrays#g;
     s#/opt/python/cp3[0-9]+-cp3[0-9]+/include/python3\.[0-9]+#$include#g"
build="$(mktemp -d)"
trap 'rm -rf "$build"' EXIT
export PATH="$venv/bin:$PATH" AMENT_PREFIX_PATH="$venv" CMAKE_PREFIX_PATH="$venv" ROS_VERSION=2
cmake -G Ninja -S "$here/usv_gym_msgs" -B "$build" -DCMAKE_INSTALL_PREFIX="$venv" -DCMAKE_BUILD_TYPE=Release \
    -DBUILD_TESTING=OFF -DPython3_EXECUTABLE="$py" -DPython3_ROOT_DIR="$venv" > "$build/log" 2>&1 &&
    ninja -C "$build" install >> "$build/log" 2>&1 || { tail -40 "$build/log" >&2; exit 1; }
if [ -n "$python" ]; then
    # a file of paths is read behind the environment's own packages, so those win
    "$python" -c 'import pathlib, sys, usv_gym
print(*(p for p in sys.path if "packages" in p), pathlib.Path(usv_gym.__file__).parents[1], sep="\n")' > "$venv/lib/python3.11/site-packages/zz_usv_gym.pth"
    printf '#!%s\nfrom usv_gym.cli import main\n\nif __name__ == "__main__":\n    main()\n' "$py" > "$venv/bin/usv-gym"
    chmod +x "$venv/bin/usv-gym"
fi
"$py" -c 'from usv_gym_msgs.msg import Targets; import rclpy'
