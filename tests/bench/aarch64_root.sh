#!/bin/sh
# A folder in which the board's Python runs on another machine: qemu, arm64 Python, numpy and onnxruntime.
# Usage: aarch64_root.sh FOLDER. Needs apt and pip; installs nothing outside FOLDER. Then: FOLDER/python SCRIPT ...
set -eu
root=$(mkdir -p "$1" && cd "$1" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
python=${PYTHON:-$here/../../.venv/bin/python}
pins=$here/../../requirements/base.lock
[ -x "$root/python" ] && exit 0

mkdir -p "$root/debs" "$root/host" "$root/arm64" "$root/apt/lists/partial" "$root/apt/cache/archives/partial" "$root/wheels"
: >"$root/apt/status"
cd "$root/debs"
apt-get download -q qemu-user-static
foreign="-o APT::Architecture=arm64 -o APT::Architectures::=arm64 -o Dir::State=$root/apt -o Dir::State::status=$root/apt/status
 -o Dir::Cache=$root/apt/cache -o Dir::Etc::sourceparts=- -o APT::Sandbox::User=root"
sources=/etc/apt/sources.list
[ -s "$sources" ] || sources=/etc/apt/sources.list.d/debian.sources
# shellcheck disable=SC2086
apt-get $foreign -o Dir::Etc::sourcelist="$sources" update -q
# shellcheck disable=SC2086
apt-get $foreign -o Dir::Etc::sourcelist="$sources" download -q \
    python3.11-minimal libpython3.11-minimal libpython3.11-stdlib libc6 libgcc-s1 libstdc++6 zlib1g libexpat1 libffi8 \
    libbz2-1.0 liblzma5 libssl3 libuuid1 libsqlite3-0 libreadline8 libtinfo6
for deb in *.deb; do
    case $deb in *arm64.deb) dpkg -x "$deb" "$root/arm64" ;; *) dpkg -x "$deb" "$root/host" ;; esac
done

for wheel in numpy onnxruntime flatbuffers protobuf packaging; do
    pin=$(sed -n "s/^\($wheel==[^ ]*\).*/\1/p" "$pins")
    pin=${pin:-$wheel}
    "$python" -m pip download -q --no-deps --only-binary=:all: --python-version 3.11 --implementation cp \
        --platform manylinux_2_28_aarch64 --platform manylinux_2_27_aarch64 --platform manylinux_2_17_aarch64 \
        --platform manylinux2014_aarch64 -d "$root/wheels" "$pin"
done
for wheel in "$root"/wheels/*.whl; do "$python" -m zipfile -e "$wheel" "$root/arm64/site"; done

# onnxruntime counts cores in files that qemu would otherwise answer with the host's.
mkdir -p "$root/arm64/proc" "$root/arm64/sys/devices/system/cpu"
for core in 0 1 2 3; do
    mkdir -p "$root/arm64/sys/devices/system/cpu/cpu$core/cpufreq" "$root/arm64/sys/devices/system/cpu/cpu$core/topology"
    printf 'processor\t: %s\nFeatures\t: fp asimd evtstrm aes pmull sha1 sha2 crc32 cpuid\nCPU implementer\t: 0x41\nCPU architecture: 8\nCPU variant\t: 0x0\nCPU part\t: 0xd03\nCPU revision\t: 4\n\n' "$core"
done >"$root/arm64/proc/cpuinfo"
for list in possible present online; do echo 0-3 >"$root/arm64/sys/devices/system/cpu/$list"; done
echo 3 >"$root/arm64/sys/devices/system/cpu/kernel_max"

cat >"$root/python.partial" <<RUN
#!/bin/sh
exec env QEMU_LD_PREFIX="$root/arm64" PYTHONHOME="$root/arm64/usr" PYTHONPATH="$root/arm64/site" PYTHONDONTWRITEBYTECODE=1 \\
    "$root/host/usr/bin/qemu-aarch64-static" -cpu cortex-a53 "$root/arm64/usr/bin/python3.11" "\$@"
RUN
chmod +x "$root/python.partial"
mv "$root/python.partial" "$root/python"
