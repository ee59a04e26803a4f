#!/usr/bin/env bash
# Subjects of the commits that main does not have: at most 72 characters, no full stop at the end. In a clone without main: the
# newest commit's.
cd "$(dirname "$0")/.." || exit
git rev-parse --verify --quiet HEAD >/dev/null || exit 0 # not a clone
if range=$(git merge-base HEAD main 2>/dev/null) && [ "$range" != "$(git rev-parse HEAD)" ]; then range+=..HEAD; else range='-1'; fi
wrong=$(git log --format='%s' "$range" | awk 'length > 72 || /[.]$/')
[ -z "$wrong" ] || {
  echo "a commit's subject has at most 72 characters and no full stop at its end: $wrong"
  exit 1
}
