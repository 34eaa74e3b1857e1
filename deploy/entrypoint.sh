#!/bin/sh
# Entry point of the container: `wait` for commands run in it, or run any command of grebe.
set -eu

if [ ! -w /data ]; then
    echo "grebe: /data cannot be written; on the computer that holds it, type once:" \
         "sudo chown 1000:1000 FOLDER" >&2
    exit 3
fi

if [ "${1:-wait}" != wait ]; then
    exec grebe "$@"
fi

# Compile the controller now, before the boat is in the water.
python -c 'from grebe.cli.output import compile_once; compile_once()' ||
    echo "grebe: the controller could not be compiled; the first run tries again." >&2
echo "grebe: ready; run commands with: docker exec -it CONTAINER grebe ..." >&2
trap 'exit 0' TERM INT
while :; do
    sleep 3600 &
    wait $!
done
