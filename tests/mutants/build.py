# SPDX-License-Identifier: MIT
"""One way to build the copy: as shipped, with sanitizers, or with marks of coverage.

All of the product is one shared library. So a mutant costs one object, or the ones that include a header, and one run of the
linker. Programs find the library by LD_LIBRARY_PATH. A mutant's file lies in a folder of its worker, `changed`, which the compiler
searches first.
"""
import hashlib
import os
import shlex
import threading

from tree import MAIN, MOST_MEMORY, PRODUCT, read

LIBRARY = "libmodules.so"


class Build:
    def __init__(self, tree, name, settings, link, tests=()):
        """`settings` are make's, `link` is the linker's command, and `tests` are sources of tests that are compiled, too."""
        self.tree, self.name, self.link_words = tree, name, shlex.split(link)
        self.folder, self.work = f"build/{name}", f"{tree.path}/build/{name}"  # programs find readers of IFC above their own folder
        self.commands, self.deps, self.codes, self.locks, self.lock = {}, {}, {}, {}, threading.Lock()
        words = [*shlex.split(settings), f"BUILD={self.folder}", "objects", *(f"{self.folder}/{source}.o" for source in tests)]
        tree.make(*words)
        self.read_commands(tree.make("-n", "-B", "V=1", *words))
        self.read_deps()
        self.link_library(self.work, {})
        self.archive = [f"{self.work}/common.a"] if any(source in self.commands for source in tree.common()) else []
        for archive in self.archive:
            tree.call(["ar", "rcs", archive, *map(self.object, tree.common())])
        if MAIN in self.commands:
            self.link_program([self.object(MAIN)], f"{self.work}/scanhead")

    def read_commands(self, text):
        """Reads the commands that make prints, because a mutant is compiled by the same ones."""
        for line in text.splitlines():
            words = shlex.split(line) if " -c " in line and " -o " in line else []
            name = words[words.index("-c") + 1] if words else ""
            if words and words[words.index("-o") + 1] == self.object(name):  # main.c has a second object for scanheadd
                self.commands[name] = words

    def read_deps(self):
        """Finds the sources, of the product and of tests, that include a file."""
        for name in self.commands:
            rule = read(f"{self.tree.path}/{self.folder}/{name}.d").decode().replace("\\\n", " ").split("\n")[0]
            for used in rule.split()[1:]:
                self.deps.setdefault(os.path.normpath(used), set()).add(name)

    def object(self, name):
        return f"{self.folder}/{name}.o"

    def environment(self, folder=None):
        """Makes the environment of a program, with the library in a folder or the one without a mutant.

        A test may have functions and variables of the library in its own form, which sanitizers would refuse."""
        options = {"ASAN_OPTIONS": f"detect_odr_violation=0:hard_rss_limit_mb={MOST_MEMORY >> 20}"}
        return {"LD_LIBRARY_PATH": folder or self.work, **(options if self.name == "asan" else {})}

    # ---- linking

    def link_library(self, folder, changed):
        """`changed` has the objects that take the place of others, by their source."""
        objects = [changed.get(name, self.object(name)) for name in sorted(self.commands) if name.startswith(PRODUCT) and name != MAIN]
        self.link(["-shared", f"-Wl,-soname,{LIBRARY}"], objects, f"{folder}/{LIBRARY}")

    def link_program(self, objects, target):
        self.link([f"-Wl,-rpath,{self.work}", "-Wl,--enable-new-dtags"], [*objects, f"{self.work}/{LIBRARY}"], target)

    def link_head(self, folder, changed):
        """Links the head with the library in a folder, whatever LD_LIBRARY_PATH says: a test of another build starts it."""
        self.link([f"-Wl,-rpath,{folder}", "-Wl,--disable-new-dtags"], [changed.get(MAIN, self.object(MAIN)), f"{folder}/{LIBRARY}"], f"{folder}/head")
        return f"{folder}/head"

    def link(self, options, objects, target):
        """Links again only where an object is newer."""
        newest = max(os.path.getmtime(os.path.join(self.tree.path, name)) for name in objects)
        if not os.path.exists(target) or os.path.getmtime(target) < newest:
            os.makedirs(os.path.dirname(target), exist_ok=True)
            self.tree.call([*self.link_words, *options, "-o", f"{target}.new", *objects, *shlex.split(os.environ["LIBS"])])
            os.replace(f"{target}.new", target)

    def program(self, name):
        """Returns the path of a test program without a mutant. It is linked when it is first asked for."""
        target = f"{self.work}/tests/{name}"
        with self.lock:
            lock = self.locks.setdefault(name, threading.Lock())
        with lock:
            self.link_program([*map(self.object, self.tree.sources_of(name)), *self.archive], target)
        return target

    def program_with(self, header, worker, name):
        """Does the same with a mutant. A test that includes its file is compiled again. Returns None if it does not compile."""
        users = self.deps.get(header, ())
        own, common = ([source for source in sources if source in users] for sources in (self.tree.sources_of(name), self.tree.common()))
        if not own and not common:
            return self.program(name)
        objects = {source: self.compile(source, worker) for source in own + common}
        if None in objects.values():
            return None
        target = f"{worker}/{self.name}/tests/{name}"
        self.link_program([*(objects.get(source, self.object(source)) for source in self.tree.sources_of(name)),
                           *(objects[source] for source in common), *self.archive], target)
        return target

    # ---- compiling

    def compile(self, name, worker):
        """Compiles a source with the worker's mutant. Returns None if that fails or warns, because `make test` sees both."""
        words, target, changed = list(self.commands[name]), f"{worker}/{self.name}/{name}.o", f"{worker}/changed"
        if os.path.exists(f"{changed}/{name}"):
            words[words.index("-c") + 1] = f"{changed}/{name}"
        words[words.index("-o") + 1] = target
        words.insert(words.index("-I."), f"-I{changed}")
        if not os.path.exists(target):
            os.makedirs(os.path.dirname(target), exist_ok=True)
            self.tree.attempt([*words, f"-fmacro-prefix-map={changed}/="])
        return target if os.path.exists(target) else None

    def code_before(self, name):
        """Returns the hash of a source's object without a mutant. It is computed once."""
        if name not in self.codes:
            self.codes[name] = self.code_of(self.object(name))
        return self.codes[name]

    def code_of(self, name):
        """Hashes an object without its debug information, because that has lines and columns of the source."""
        bare = f"{self.work}/bare-{threading.get_ident()}"
        self.tree.call(["strip", "--strip-debug", "-o", bare, name])
        code = hashlib.sha256(read(bare)).hexdigest()
        os.remove(bare)
        return code
