#!/usr/bin/env bash
# The README's first commands as a newcomer runs them: in a minimal Debian that has `make` and nothing else of ours,
# on a copy of the tracked files, so that nothing left on this machine hides a missing step.
# Usage: newcomer.sh [CALL...]: what make is asked for after `make run`, as in `newcomer.sh check "test EXTRAS=host,dev,train"`
# (default: check). Needs root, apt and git.
#
# The root lies in memory, in a mount and process name space of its own: when the last process in it ends, however it
# ends, its files and mounts are gone, and this machine's mounts were never touched.
set -euo pipefail
SUITE=bookworm # the oldest Debian whose Python is new enough
NEEDED_KB=$((6 * 1024 * 1024))
STEP_TIMEOUT=${STEP_TIMEOUT:-600}
cd "$(dirname "$0")/.."

fail() {
    echo "newcomer: $*" >&2
    exit 2
}

step() { # NAME COMMAND...: says how long it took
    local begin=$SECONDS
    doing=$1
    shift
    echo "newcomer: $doing"
    "$@"
    echo "newcomer: $doing: $((SECONDS - begin)) s"
}

debian_sources() { # this machine's own mirrors, as lines for sources.list
    # shellcheck disable=SC2016
    apt-get indextargets --format '$(ORIGIN) $(RELEASE) $(REPO_URI) $(COMPONENT)' 'Identifier: Packages' |
        awk -v suite="$SUITE" '$1 == "Debian" && index($2, suite) == 1 && $4 == "main" { print "deb", $3, $2, $4 }' | sort -u
}

carry() { # PATH...: files are copied into the root, folders are shown there, read only
    local path
    for path in "$@"; do
        if [ -d "$path" ] && [ "$path" != / ]; then
            mkdir -p "$root$path"
            mount --bind -o ro "$path" "$root$path"
        elif [ -f "$path" ]; then
            mkdir -p "$root$(dirname "$path")"
            cp -L "$path" "$root$path"
        fi
    done
}

carry_network_settings() { # names, proxies and certificates
    carry /etc/resolv.conf /etc/hosts /etc/ssl/certs/ca-certificates.crt /usr/local/share/ca-certificates
    apt-config dump | grep -E '^Acquire::(https?|ftp|Check-|ForceIP|Retries)' >"$root/etc/apt/apt.conf.d/99machine" || true
}

carry_pip_settings() { # its configuration, the folders that this names, and what it has downloaded
    local configs=(/etc/pip.conf /etc/xdg/pip/pip.conf "$HOME/.pip/pip.conf" "$HOME/.config/pip/pip.conf" "${PIP_CONFIG_FILE:-}")
    local config word cache=${PIP_CACHE_DIR:-$HOME/.cache/pip} found=()
    for config in "${configs[@]}"; do
        [ ! -f "$config" ] || found+=("$config")
    done
    carry "${found[@]}"
    for word in $({ [ ${#found[@]} -eq 0 ] || cat "${found[@]}"; } | sed -n 's/^[^#;]*=//p') $(env | sed -n 's/^PIP_[A-Z_]*=//p'); do
        case $word in
        file:///*) carry "$(dirname "${word#file://}")" ;; # an index's files lie beside it
        /*) [ "$word" = "$cache" ] || carry "$word" ;;
        esac
    done
    mkdir -p "$cache" "$root/root/.cache/pip"
    mount --bind "$cache" "$root/root/.cache/pip"
}

in_root() { # COMMAND...: with nothing of this machine's environment but how to reach the network
    local name environment=(PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root)
    for name in $(compgen -e); do
        case $name in
        PIP_CACHE_DIR) ;;
        CI | PIP_* | SSL_CERT_* | REQUESTS_CA_BUNDLE | *_proxy | *_PROXY) environment+=("$name=${!name}") ;;
        esac
    done
    timeout "$STEP_TIMEOUT" chroot "$root" env -i "${environment[@]}" sh -c 'cd /root/paani && exec "$@"' sh "$@"
}

make_root() {
    mount -t tmpfs -o mode=755,size=${NEEDED_KB}k newcomer "$root"
    debian_sources | mmdebstrap --quiet --variant=minbase --include=make "$SUITE" "$root" -
    mount -t proc proc "$root/proc"
    mount -t sysfs -o ro sysfs "$root/sys"
    mount -t devpts -o newinstance,ptmxmode=666 devpts "$root/dev/pts"
    mount -t tmpfs -o mode=1777 shm "$root/dev/shm"
    carry_network_settings
    carry_pip_settings
    mkdir "$root/root/paani"
    git ls-files -z | tar -c --null -T - | tar -x -C "$root/root/paani"
}

inside() { # ROOT CALL...
    local call
    root=$1
    shift
    trap '[ $? -eq 0 ] || echo "newcomer: $doing: failed" >&2' EXIT
    step "a minimal $SUITE" make_root
    step "make run" in_root make run ARGS="--headless --for 20"
    for call in "$@"; do
        # shellcheck disable=SC2086 # a call is words
        step "make $call" in_root make $call
    done
    step "a page in the browser" in_root .venv/bin/python -m pytest -q tests/browser/test_models_report.py
    df -k --output=used "$root" | awk 'NR == 2 { printf "newcomer: the root took %d MB\n", $1 / 1024 }'
}

clean() {
    [ -z "${child:-}" ] || { kill -KILL "$child" && wait "$child"; } 2>/dev/null || true
    [ -z "${root:-}" ] || rmdir "$root"
}

if [ "${1:-}" = --inside ]; then
    shift
    inside "$@"
    exit
fi

[ "$(id -u)" -eq 0 ] || fail "needs root, to make a root file system"
command -v apt-get >/dev/null || fail "needs apt-get, to make a minimal Debian"
[ "$(awk '$1 == "MemAvailable:" { print $2 }' /proc/meminfo)" -ge "$NEEDED_KB" ] || fail "needs $NEEDED_KB kB of free memory"
unshare --mount --pid --fork true || fail "this machine allows no mount and process name spaces"
apt-get update -q
sh deploy/system-packages.sh mmdebstrap
[ -n "$(debian_sources)" ] || fail "apt knows no mirror of Debian $SUITE here"

trap clean EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
root=$(mktemp -d)
unshare --mount --propagation private --pid --fork --kill-child ".ci/$(basename "$0")" --inside "$root" "${@:-check}" </dev/null &
child=$!
wait "$child"
