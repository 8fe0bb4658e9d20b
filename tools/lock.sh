#!/usr/bin/env bash
# Resolves pyproject.toml in a new environment and writes every version down.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder"
"$folder/bin/pip" install --quiet --upgrade pip
freeze() { "$folder/bin/pip" freeze --exclude cylinder-friction --exclude cylinder-friction-live | sed -E 's/^(torch==[0-9.]+).*/\1/'; }
"$folder/bin/pip" install --quiet '.[pipeline]' ./live
{ echo "# Every version of the run-time environment; made by tools/lock.sh."; freeze; } > requirements.lock
"$folder/bin/pip" install --quiet '.[dev]' './live[opcua]'
{ echo "# What development adds to requirements.lock; made by tools/lock.sh."
  freeze | grep -vxFf requirements.lock; } > requirements-dev.lock
