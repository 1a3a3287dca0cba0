# The front door on a bare Debian 12 machine. `make demo` and `make test` install what is missing, build and run.
.PHONY: demo viewer page python ros1 ros1-demo ros2 deb site sbom fuzz faults kills soak coverage test oracles build configure packages bench lint format sanitize sanitize-readers clean
JOBS ?= $(shell nproc)
# What ccache keeps of one clone serves the others.
export CCACHE_BASEDIR ?= $(CURDIR)
export CCACHE_NOHASHDIR ?= 1

demo: packages page configure
	cmake --build --preset release --parallel $(JOBS) --target revisit
	@ln -sfn release/revisit build/revisit
	@scripts/demo.sh

# The node of ROS 1: `. build/ros1/setup.bash`, then roslaunch revisit_ros ... (bindings/ros1/README.md).
ros1: packages
	@scripts/install_packages.sh $$(grep -v '^#' bindings/ros1/packages.txt)
	@cmake --preset release --log-level=NOTICE > /dev/null
	cmake --build --preset release --parallel $(JOBS) --target revisit revisit_ros1 revisit_ros1_python
	@ln -sfn release/revisit build/revisit
	@cmake --install build/release --component ros1 --prefix build/ros1 > /dev/null

ros1-demo: ros1
	@scripts/ros1_demo.sh

# A node that speaks to ROS 2 without ROS 2 (bindings/ros2/README.md).
ros2: packages
	@scripts/install_packages.sh $$(grep -v '^#' bindings/ros2/packages.txt)
	@cmake --preset release --log-level=NOTICE > /dev/null
	cmake --build --preset release --parallel $(JOBS) --target revisit_dds_node

# The Python package as a wheel (out/python), installed into a fresh environment and tested there.
python: packages viewer
	@scripts/install_packages.sh $$(grep -v '^#' bindings/python/packages.txt)
	@mkdir -p out/python && rm -rf out/python/* bindings/python/build bindings/python/*.egg-info
	cd bindings/python && REVISIT_PYTHON_BUILD=$(CURDIR)/build/python /usr/bin/python3 -m build --wheel --no-isolation --outdir ../../out/python > /dev/null
	@rm -rf bindings/python/build bindings/python/*.egg-info
	@/usr/bin/python3 -m venv --system-site-packages out/python/venv
	@out/python/venv/bin/pip install --quiet --no-index --no-deps out/python/*.whl
	cd out/python && venv/bin/python -m pytest -q -p no:cacheprovider ../../bindings/python/tests
	@ls -sh out/python/*.whl

# Debian packages in out/deb, looked at by lintian.
deb: build
	@scripts/install_packages.sh dpkg-dev fakeroot file help2man lintian
	@help2man --no-info --name "recognise places from LiDAR" build/release/revisit | gzip -9n > build/release/debian/revisit.1.gz
	@rm -rf out/deb && cd build/release && cpack -G DEB > cpack.log || { cat cpack.log; exit 1; }
	@rm -rf out/deb/_CPack_Packages
	@ls -sh out/deb/*.deb
	lintian --fail-on error out/deb/*.deb

# The documentation in out/site/index.html.
site:
	@scripts/install_packages.sh doxygen mkdocs mkdocs-material
	@scripts/site.sh

# What the program is made of, with versions: out/sbom.json (CycloneDX).
sbom: build
	@scripts/sbom.py build/release/revisit out/sbom.json

# Every reader against clang's fuzzer: half an hour each; SECONDS=60 for a look.
fuzz: build
	@scripts/fuzz.sh $(SECONDS)

# Every write, sync, rename, opening and allocation fails once: hours; MOST=50 for some of each.
faults: build
	tests/faults/run_faults.py build/release/revisit build/release/tests/libfail_call.so --most $(or $(MOST),0)

# The share of the lines of src/ that the tests run, and out/coverage.txt.
coverage: packages
	@scripts/coverage.sh

# An hour at the pace of a sensor through slam and localise; MINUTES=10 for a look.
soak: build
	@scripts/soak.sh $(MINUTES)

# slam is killed, and loses its power, at random moments, and is resumed: 200 times, or KILLS=N, of each way to run it.
kills: build
	tests/resume_test.py build/release/revisit --power build/release/tests/liblose_power.so --kills $(or $(KILLS),200)

test: oracles browser build
	ctest --preset release --parallel $(JOBS)

build: packages page configure
	cmake --build --preset release --parallel $(JOBS)
	@ln -sfn release/revisit build/revisit

configure: packages | page
	@cmake --preset release --log-level=NOTICE > /dev/null

# Without npm, or its registry, the program is built without its page.
page: packages
	@$(MAKE) --no-print-directory viewer || { [ -z "$$CI" ] && echo "the page of revisit view is left out: npm could not build it (above)"; }

# The page of `revisit view`, which the program carries: rebuilt where its sources are newer.
viewer: apps/viewer/dist/viewer.js
apps/viewer/dist/viewer.js: apps/viewer/node_modules/.package-lock.json $(wildcard apps/viewer/src/*) apps/viewer/index.html apps/viewer/vite.config.js apps/viewer/tsconfig.json apps/viewer/package.json
	@npm run build --prefix apps/viewer --silent
	@touch $@
apps/viewer/node_modules/.package-lock.json: apps/viewer/package-lock.json | packages
	@command -v npm > /dev/null || scripts/install_packages.sh nodejs npm
	@npm ci --prefix apps/viewer --ignore-scripts --no-audit --no-fund --omit=peer --loglevel=error > /dev/null
	@touch $@

# What the page is tested in.
browser: packages
	@scripts/install_packages.sh $$(grep -v '^#' apps/viewer/packages.txt)

# The library of the .mcap format, with which tests compare ours.
oracles: packages
	@command -v npm > /dev/null || scripts/install_packages.sh nodejs npm
	@[ -d tests/oracles/mcap/node_modules ] || npm ci --prefix tests/oracles/mcap --ignore-scripts --no-audit --no-fund --silent

packages:
	@scripts/install_packages.sh

# Figures as a table and as JSON in out/bench; ratios, not milliseconds, are comparable between machines.
bench: build
	@mkdir -p out/bench
	@for b in build/release/bin/bench_*; do $$b --benchmark_out=out/bench/$$(basename $$b).json --benchmark_out_format=json; done

# The whole test suite under AddressSanitizer and UndefinedBehaviorSanitizer.
sanitize: packages
	@cmake --preset debug --log-level=NOTICE > /dev/null
	cmake --build --preset debug --parallel $(JOBS)
	ctest --preset debug --parallel $(JOBS)

# The same for what reads files, and maps: a few minutes.
READERS = core_test config_test io_test store_test retrieval_test
empty :=
sanitize-readers: packages
	@cmake --preset debug --log-level=NOTICE > /dev/null
	cmake --build --preset debug --parallel $(JOBS) --target $(READERS)
	ctest --preset debug --parallel $(JOBS) -L '^($(subst $(empty) ,|,$(READERS)))$$'

SOURCES = $(shell git ls-files '*.cpp' '*.hpp' '*.h')
lint: packages
	@scripts/install_packages.sh clang-format clang-tidy
	@cmake --preset debug --log-level=NOTICE > /dev/null
	@cmake --build --preset debug --target generated_sources > /dev/null
	@clang-format --dry-run --Werror $(SOURCES)
	python3 scripts/check_layers.py
	@scripts/tidy.sh $(JOBS)

format:
	@scripts/install_packages.sh clang-format
	@clang-format -i $(SOURCES)

clean:
	rm -rf build out
