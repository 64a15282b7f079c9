#!/bin/sh
# A base image without a registry: `base-image.sh NAME [arm64]` makes a Debian with Python from this machine's own mirror.
# Certificates that this machine trusts go in, as its network may need them. Needs root, debootstrap and an engine.
set -eu
name=${1:?usage: base-image.sh NAME [arm64]}
machine=${2:-}
sh "$(dirname "$0")/system-packages.sh" debootstrap
mirror=$(apt-get indextargets --format '$(ORIGIN) $(RELEASE) $(REPO_URI)' 'Identifier: Packages' |
    awk '$1 == "Debian" && $2 == "bookworm" { print $3; exit }')
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
root=$folder/root
bootstrap() {
    debootstrap --variant=minbase --include=python3,python3-venv,ca-certificates "$@" bookworm "$root" "$mirror" >"$folder/log" ||
        { tail -5 "$folder/log" >&2; exit 1; }
}
if [ -z "$machine" ]; then
    bootstrap
else # packages are unpacked and not configured: their scripts would run for a quarter of an hour under emulation
    bootstrap --foreign --arch="$machine"
    for package in "$root"/var/cache/apt/archives/*.deb; do
        dpkg-deb --fsys-tarfile "$package" | tar -x -C "$root" --keep-directory-symlink
    done
    cp "$root"/usr/share/base-passwd/passwd.master "$root/etc/passwd"
    cp "$root"/usr/share/base-passwd/group.master "$root/etc/group"
    rm -rf "$root/debootstrap" "$root/proc" "$root/sys" # links to this machine's, in some places
    mkdir "$root/proc" "$root/sys"
fi
rm -rf "$root"/var/cache/apt/archives/*.deb
mkdir -p "$root/etc/ssl/certs"
cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
tar -C "$root" -c . >"$folder/root.tar"
rm -rf "$root"
printf 'FROM scratch\nADD root.tar /\nENV PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin PIP_CERT=/etc/ssl/certs/ca-certificates.crt\n' \
    >"$folder/Dockerfile"
docker build -q ${machine:+--platform "linux/$machine"} -t "$name" "$folder"
