#!/bin/sh
# Board and host in containers of this one machine, each on networks of its own: `containers.sh up` or `down`.
# What it does by hand is what deploy/README.md says for two machines.
set -eu
here=$(dirname "$0")
board="docker compose -f $here/compose.board.yaml"
host="docker compose -f $here/compose.host.yaml"
case ${1-} in
up)
    # Where this machine's containers reach it, and nobody else does.
    PAANI_LINK_ADDRESS=$(docker network inspect bridge -f '{{(index .IPAM.Config 0).Gateway}}')
    export PAANI_LINK_ADDRESS COMPOSE_PROFILES="${COMPOSE_PROFILES:-sim}"
    $board up -d --build --wait
    $host build
    $board exec -T router tar -c credentials | $host run --rm -T --no-deps --entrypoint tar setup -x
    $host up -d --wait
    echo "the page: http://127.0.0.1:${PAANI_PAGE_PORT:-8043}/#key=$($host exec -T operator cat operator-key)"
    ;;
down)
    $host --profile '*' down --volumes
    $board --profile '*' down --volumes
    ;;
*)
    echo "usage: containers.sh up|down" >&2
    exit 2
    ;;
esac
