#!/bin/sh
# `compose_plugin.sh FOLDER`: Compose 2 and BuildKit of a newer Debian into FOLDER/cli-plugins, for an engine that has none.
# Nothing is installed: Debian 12 has Compose 1 alone. Needs root and apt.
set -eu
folder=${1:?usage: compose_plugin.sh FOLDER}
mkdir -p "$folder/cli-plugins" "$folder/apt/lists/partial" "$folder/apt/archives/partial"
cd "$folder/apt"
mirror=$(apt-get indextargets --format '$(ORIGIN) $(RELEASE) $(REPO_URI)' 'Identifier: Packages' |
    awk '$1 == "Debian" && $2 !~ /-/ { print $3; exit }')
echo "deb $mirror trixie main" >sources.list
cat >apt.conf <<END
Dir::Etc::sourcelist "$PWD/sources.list"; Dir::Etc::sourceparts "-"; Dir::State::lists "$PWD/lists"; Dir::Cache "$PWD";
APT::Sandbox::User "root";
END
export APT_CONFIG="$PWD/apt.conf"
apt-get update -q >log
apt-get download -q docker-compose docker-buildx >>log
for package in *.deb; do dpkg -x "$package" files; done
cp files/usr/libexec/docker/cli-plugins/docker-* ../cli-plugins/
cd .. && rm -rf apt
