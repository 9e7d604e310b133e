# Sourced by ./run, ./test and the scripts here. Everything runs from the root of the project.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '\033[1m%s\033[0m\n' "== $*" >&2; }
[ -t 2 ] || say() { printf '%s\n' "== $*" >&2; }

die() {
  printf '%s: %s\n' "$(basename "$0")" "$*" >&2
  exit 1
}

processors() { nproc 2>/dev/null || echo 2; }

# Where the development recordings are; tests that need one are skipped when it is absent.
data_folder() { echo "${PARALLAX_DATA_DIR:-$PWD/../shared/data}"; }

# Warnings are errors with the compiler the project is written with; another one may warn of more.
warnings_as_errors() {
  case "$(c++ -dumpversion 2>/dev/null)" in
    12 | 12.*) echo ON ;;
    *) echo OFF ;;
  esac
}

# configure PRESET [cmake arguments...]: says nothing unless it fails.
configure() {
  local preset=$1 log
  shift
  log=$(mktemp)
  if ! cmake --preset "$preset" -DPARALLAX_WARNINGS_AS_ERRORS="$(warnings_as_errors)" \
    -DPARALLAX_DATA_DIR="$(data_folder)" "$@" >"$log" 2>&1; then
    cat "$log" >&2
    rm -f "$log"
    die "cmake --preset $preset failed"
  fi
  rm -f "$log"
}
