#!/bin/sh
# The health check of a container: `beats SERVICE` is true while the service's event loop turns. It starts no Python.
# A process that has hung for HANG_S is ended, as systemd's watchdog would, and the engine starts it again; one that
# has never beaten is starting.
FRESH_S=5
HANG_S=15
beat=$(cat "${HEARTBEATS:-/var/lib/paani/heartbeats}/$1" 2>/dev/null) # the machine's uptime then
[ -n "$beat" ] || exit 1
read -r uptime _ </proc/uptime
age=$((${uptime%.*} - beat))
[ "$age" -ge "$HANG_S" ] && kill -KILL -1 # all but the container's init, which then ends
[ "$age" -lt "$FRESH_S" ]
