#!/usr/bin/env bash
# The documentation as a site in out/site: README and docs/ by MkDocs, the C++ interface by Doxygen. Links that lead
# nowhere are errors.
set -euo pipefail
cd "$(dirname "$0")/.."
sources=out/site_sources
rm -rf "$sources" out/site
mkdir -p "$sources"
cp -r docs/*.md docs/images "$sources"
cp README.md "$sources/index.md"
for page in CHANGELOG CONTRIBUTING SECURITY; do cp "$page.md" "$sources/${page,,}.md"; done
for page in ros1 ros2 python; do cp "bindings/$page/README.md" "$sources/$page.md"; done
printf '# API\nThe public headers, their functions and figures: [C++ interface](api/index.html).\n' > "$sources/api.md"
# Pages lie beside each other here; what is no page is named, not linked.
pages=$(cd "$sources" && ls ./*.md | sed 's|^\./||; s|\.md$||' | paste -sd'|')
sed -E -i \
  -e 's#\]\((\.\./)*docs/#](#g' \
  -e 's#\]\((\.\./)*(bindings/)?(ros1|ros2|python)/README\.md#](\3.md#g' \
  -e 's#\]\((\.\./)*README\.md#](index.md#g' \
  -e 's#\]\((\.\./)*(CHANGELOG|CONTRIBUTING|SECURITY)\.md#](\L\2.md#g' \
  -e 's#\[([^]]*)\]\((\.\./)*(LICENSE|examples|src|apps|bindings|scripts|tests|benchmarks|cmake|packages|notebooks|launch|node|dds|rosdep)[^)]*\)#`\1`#g' "$sources"/*.md
{
  cat << 'DOXYFILE'
PROJECT_NAME = revisit
INPUT = src/revisit
FILE_PATTERNS = *.hpp *.h
EXCLUDE_PATTERNS = */internal/*
RECURSIVE = YES
STRIP_FROM_INC_PATH = src
OUTPUT_DIRECTORY = out/site_sources
HTML_OUTPUT = api
GENERATE_LATEX = NO
QUIET = YES
WARN_IF_UNDOCUMENTED = NO
HAVE_DOT = NO
SHOW_INCLUDE_FILES = YES
DOXYFILE
} > out/Doxyfile
doxygen out/Doxyfile 2> out/doxygen.log || { cat out/doxygen.log; exit 1; }
rm -rf out/api && mv "$sources/api" out/api  # MkDocs has no part in it
mkdir -p "$sources/api" && printf 'made by Doxygen\n' > "$sources/api/index.html"
mkdocs build --strict --quiet -f docs/mkdocs.yml
rm -rf out/site/api && mv out/api out/site/api
echo "out/site/index.html: $(find out/site -name '*.html' | wc -l) pages"
