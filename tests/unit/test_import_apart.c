/* SPDX-License-Identifier: MIT */
/* These tests import by Assimp in a process of its own. Limits, crashes and the end of either process give one line,
 * and nothing stays behind. */
#include <dlfcn.h>
#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <sys/pidfd.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>

#include <assimp/version.h>

#include "core/assimp_lib.h"
#include "core/import/import_apart.h"
#include "core/scene/build_load.h"
#include "tests/common/collada.h"
#include "tests/unit/scene_files.h"

#define HOUSE "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc"

/* ---- the process. The test's own loader of libraries makes Assimp hang for a mesh of this name. */

#define ENDLESS "endless.dae"

static const struct aiScene *(*read_file)(const char *, unsigned, struct aiFileIO *, const struct aiPropertyStore *);

static const struct aiScene *hang_or_read(const char *file, unsigned flags, struct aiFileIO *io,
                                          const struct aiPropertyStore *options)
{
    while (strstr(file, ENDLESS) != NULL)
        pause();
    return read_file(file, flags, io, options);
}

static int n_loads; /* in this process: a fork counts its own */

int late_load(enum late_library which, const char *const *name, void *calls, size_t n, struct sh_err *err)
{
    (void)err;
    assert_int_equal(which, LATE_assimp);
    n_loads++;
    void **call = calls, *own;
    for (size_t i = 0; i < n; i++) {
        call[i] = dlsym(RTLD_DEFAULT, name[i]);
        assert_non_null(call[i]);
        if (strcmp(name[i], "aiImportFileExWithProperties") != 0) continue;
        const struct aiScene *(*hangs)(const char *, unsigned, struct aiFileIO *, const struct aiPropertyStore *) =
            hang_or_read;
        memcpy(&own, &hangs, sizeof own);
        memcpy(&read_file, &call[i], sizeof read_file);
        call[i] = own;
    }
    return SH_OK;
}

static const char *endless_dae(void)
{
    return write_text(ENDLESS, "{}");
}

static void remove_endless(void)
{
    unlink(path);
}

static void no_child_is_left(void)
{
    assert_int_equal(waitpid(-1, NULL, WNOHANG), -1);
    assert_int_equal(errno, ECHILD);
}

static void hang_ends_in_time(void **state)
{
    (void)state;
    const struct scene_import_limits limits = {.memory_mib = 1024, .time_s = 0.15, .files = 64};
    const struct scene_mesh_spec spec = {.file = endless_dae(), .scale = 1, .limits = &limits};
    struct scene *s;
    struct sh_err err;
    assert_int_equal(load_spec(&spec, 1e-3, &s, &err), SH_EINPUT);
    remove_endless();
    if (strstr(err.text, "endless.dae: Assimp did not read it within 0.15 s (scene.import_s)") == NULL)
        fail_msg("%s", err.text);
    no_child_is_left();
}

/* glTF 1.0 is for Assimp, which shows only when the reader of glTF looks. The library is loaded here, not in a fork. */
static void gltf_of_old_gets_assimp_here(void **state)
{
    (void)state;
    const struct scene_mesh_spec spec = {
        .file = write_text("old.gltf", "{\"asset\":{\"version\":\"1.0\"},\"meshes\":{}}"), .scale = 1};
    struct scene *s;
    struct sh_err err;
    n_loads = 0;
    assert_int_equal(load_spec(&spec, 1e-3, &s, &err), SH_EINPUT); /* it has no mesh */
    unlink(path);
    assert_int_equal(n_loads, 1);
    assert_null(strstr(err.text, "has to read it"));
    no_child_is_left();
}

/* Assimp reads no skins of glTF 1.0, and its scene does not show that there were some. A .glb has 20 bytes before its
 * JSON. */
static void skins_of_old_gltf_are_reported(void **state)
{
    (void)state;
    static const char old[] = "{\"asset\":{\"version\":\"1.0\"},\"meshes\":{},\"skins\":{%s}}";
    for (int k = 0; k < 4; k++) {
        char text[160], glb[192];
        struct scene *s;
        struct sh_err err;
        const uint32_t n = (uint32_t)snprintf(text, sizeof text, old, k % 2 == 0 ? "\"a\":{},\"b\":{}" : "");
        const uint32_t head[4] = {1, 20 + n, n, 0};
        memcpy(glb, "glTF", 4);
        memcpy(glb + 4, head, sizeof head);
        memcpy(glb + 20, text, n);
        const char *file = k < 2 ? write_text("old.gltf", text) : write_file("old.glb", glb, 20 + n);
        const struct scene_mesh_spec spec = {.file = file, .scale = 1};
        assert_int_equal(load_spec(&spec, 1e-3, &s, &err), SH_EINPUT); /* it has no mesh */
        unlink(path);
        assert_int_equal(strstr(warnings, "it is glTF 1.0, so Assimp reads it, which ignores its 2 skins") != NULL,
                         k % 2 == 0);
    }
    no_child_is_left();
}

enum { CHATTY = 1003 };

static int warn_often(struct scene_build *b, struct sh_err *err)
{
    for (int i = 0; i < CHATTY; i++)
        sh_warn(b->report, "warning %d", i);
    return sh_fail(err, SH_EINPUT, "enough");
}

static void keep_last_warning(void *ctx, const char *text)
{
    (void)ctx;
    n_warnings++;
    snprintf(warnings, sizeof warnings, "%s", text);
}

/* A thousand warnings are shown, and the number of all. */
static void warnings_are_counted(void **state)
{
    (void)state;
    static const struct sh_report report = {.warn = keep_last_warning};
    const struct scene_mesh_spec spec = {.file = "many.dae", .scale = 1};
    struct sh_err err = {0};
    struct scene_build b;
    assert_int_equal(build_init(&b, 1e-3, &report, &err), SH_OK);
    build_begin_file(&b, &spec);
    struct import_apart a = {
        .task = {.b = &b, .limits = scene_import_defaults, .name = "a reader", .read = warn_often}};
    struct import_apart *const all[1] = {&a};
    n_warnings = 0;
    assert_int_equal(import_start(&a, &err), SH_OK);
    import_watch(all, 1);
    assert_int_equal(import_judge(&a, &err), SH_EINPUT);
    import_close(&a);
    build_release(&b);
    assert_string_equal(err.text, "enough");
    assert_int_equal(n_warnings, 1000 + 1);
    assert_string_equal(warnings, "many.dae: a reader gave 1003 warnings; the first 1000 are shown");
}

/* Judges the end of a process in a fork, under a limit of addresses (RLIMIT_AS) that no process reaches. */
static void judged_under_limit(struct import_apart *a, const char *want)
{
    const rlim_t most = (rlim_t)1 << 52; /* 4294967296 MiB */
    const struct rlimit limit = {.rlim_cur = most, .rlim_max = most};
    const pid_t pid = fork();
    if (pid == 0) {
        struct sh_err err = {0};
        _exit(setrlimit(RLIMIT_AS, &limit) == 0 && import_judge(a, &err) == SH_EINPUT && strcmp(err.text, want) == 0
                  ? 0
                  : 1);
    }
    int status;
    assert_int_equal(waitpid(pid, &status, 0), pid);
    if (status != 0) fail_msg("status %d, not '%s'", status, want);
}

/* Under `ulimit -v` a reader of IFC crashes (node: SIGTRAP, SIGSEGV), or says that memory is short. Assimp throws
 * bad_alloc. The file is not to blame. */
static void limit_of_the_user_is_named(void **state)
{
    (void)state;
#define LEAVES "; `ulimit -v` leaves it 4294967296 MiB of addresses, which may be too little: lift that limit"
    static const char *const argv[] = {"node", NULL};
    const struct scene_mesh_spec spec = {.file = "good.ifc", .scale = 1};
    struct sh_err err = {0};
    struct scene_build b;
    assert_int_equal(build_init(&b, 1e-3, NULL, &err), SH_OK);
    build_begin_file(&b, &spec);
    struct import_apart program = {.task = {.b = &b, .limits = scene_import_defaults, .name = "web-ifc", .argv = argv}};
    struct import_apart a = program;
    a.status = SIGTRAP;
    judged_under_limit(&a, "good.ifc: web-ifc crashed (SIGTRAP)" LEAVES "; the file may be broken");
    assert_int_equal(import_judge(&a, &err), SH_EINPUT); /* without the limit */
    assert_string_equal(err.text,
                        "good.ifc: web-ifc crashed while it read the file (SIGTRAP): the file is broken, or web-ifc "
                        "has a fault itself: export the mesh again, or convert it to .obj or .ply");
    a = program;
    a.status = 3 << 8;
    judged_under_limit(&a, "good.ifc: web-ifc ended without a message" LEAVES "; the file may be broken");
    sh_fail(&a.said, SH_EINPUT, "WebAssembly.Instance(): Out of memory: Cannot allocate Wasm memory");
    judged_under_limit(&a, "good.ifc: web-ifc ran out of memory" LEAVES);
    sh_fail(&a.said, SH_EINPUT, "good.ifc: memory access out of bounds"); /* a fault of the reader */
    judged_under_limit(&a, "good.ifc: memory access out of bounds");
    sh_fail(&a.said, SH_EINPUT, "good.ifc: nothing in it");
    judged_under_limit(&a, "good.ifc: nothing in it");
    /* A fork has a limit of our own as well, here 8 GiB. The lower limit counts. */
    a = program;
    a.task.argv = NULL;
    sh_fail(&a.said, SH_EINPUT, "std::bad_alloc");
    judged_under_limit(&a,
                       "good.ifc: web-ifc needs more than 8192 MiB to read it (scene.import_memory_mib): raise that "
                       "where the mesh needs more; a broken file may need any amount: export the mesh again, or "
                       "convert it to .obj or .ply");
    a.task.limits.memory_mib = UINT32_MAX; /* 8192 TiB, of which two are allowed */
    judged_under_limit(&a, "good.ifc: web-ifc ran out of memory" LEAVES);
    build_release(&b);
}

/* A program may be started with SIGCHLD ignored. The child then has no status, and its output counts. */
static void signal_of_children_may_be_ignored(void **state)
{
    (void)state;
    static const char text[] = COLLADA_TRIANGLE("0 0 0 1 0 0 0 1 0");
    const struct scene_mesh_spec good = {.file = write_text("a.dae", text), .scale = 1};
    struct scene *s;
    struct sh_err err = {0};
    void (*was)(int) = signal(SIGCHLD, SIG_IGN);
    if (load_spec(&good, 1e-3, &s, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(s->n_triangles, 1);
    scene_free(s);
    const struct scene_mesh_spec broken = {.file = write_text("a.dae", "<COLLADA"), .scale = 1};
    assert_int_equal(load_spec(&broken, 1e-3, &s, &err), SH_EINPUT);
    assert_null(strstr(err.text, "is inconsistent")); /* the child's words */
    signal(SIGCHLD, was);
    unlink(path);
}

/* The process has no descriptors left. The file is not to blame. */
static void no_descriptors_are_left(void **state)
{
    (void)state;
    const struct scene_mesh_spec spec = {.file = write_text("a.dae", "<COLLADA/>"), .scale = 1};
    struct rlimit limit, few;
    struct scene *s;
    struct sh_err err = {0};
    int next = dup(0); /* the lowest that is free */
    close(next);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &limit), 0);
    few = limit;
    few.rlim_cur = (rlim_t)next + 4; /* the result, the pipe and the process */
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &few), 0);
    int rc = load_spec(&spec, 1e-3, &s, &err);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &limit), 0);
    unlink(path);
    assert_int_equal(rc, SH_EIO);
    assert_non_null(strstr(err.text, "the descriptors of the process that reads can't be set: Too many open files"));
}

/* Assimp 5.2 does not get past a word that is no number, and keeps one index after the other. */
static void memory_is_limited(void **state)
{
    (void)state;
    static const char text[] =
        "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" "
        "version=\"1.4.1\"><library_geometries><geometry id=\"g\"><mesh>"
        "<source id=\"p\"><float_array id=\"pa\" count=\"9\">0 0 8 2 0 8 0 4 8</float_array><technique_common>"
        "<accessor source=\"#pa\" count=\"3\" stride=\"3\"><param name=\"X\" type=\"float\"/>"
        "<param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></technique_common>"
        "</source><vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>"
        "<triangles count=\"1\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1 x</p></triangles>"
        "</mesh></geometry></library_geometries></COLLADA>";
    const struct scene_import_limits limits = {.memory_mib = 32, .time_s = 60, .files = 64};
    const struct scene_mesh_spec spec = {.file = write_text("grows.dae", text), .scale = 1, .limits = &limits};
    struct scene *s;
    struct sh_err err;
    int rc = load_spec(&spec, 1e-3, &s, &err);
    unlink(path);
    assert_int_equal(rc, SH_EINPUT);
    if (strstr(err.text, "grows.dae: Assimp needs more than 32 MiB to read it (scene.import_memory_mib)") == NULL)
        fail_msg("%s", err.text);
    no_child_is_left();
}

/* One record of the house has another type. Assimp takes it for a point all the same. */
static void crash_is_one_line(void **state)
{
    (void)state;
    static const char was[] = "#215316= IFCCARTESIANPOINT", is[] = "#215316= IFCPOINTX        ";
    if (access(HOUSE, R_OK) != 0) {
        print_message("skipped: %s is missing (package assimp-testmodels)\n", HOUSE);
        skip();
    }
    FILE *f = fopen(HOUSE, "rb");
    static char text[8 << 20];
    size_t n = fread(text, 1, sizeof text, f);
    fclose(f);
    char *record = memmem(text, n, was, sizeof was - 1);
    assert_non_null(record);
    memcpy(record, is, sizeof is - 1);
    const int crashes = aiGetVersionMajor() == 5 && aiGetVersionMinor() < 4; /* later ones refuse it themselves */
    const char *want =
        crashes ? "x.ifc: Assimp crashed while it read the file (SIGSEGV)" : "x.ifc: Obj type is nullptr";
    struct scene_import_limits limits = scene_import_defaults;
    limits.ifc_reader = IFC_READER_ASSIMP;
    const struct scene_mesh_spec spec = {.file = write_file("x.ifc", text, n), .scale = 1, .limits = &limits};
    struct scene *s;
    struct sh_err err;
    assert_int_equal(load_spec(&spec, 1e-3, &s, &err), SH_EINPUT);
    unlink(path);
    if (strstr(err.text, want) == NULL) fail_msg("%s", err.text);
    no_child_is_left();
}

/* ---- the child while it reads */

static pid_t child_of(void)
{
    char name[64];
    int child = 0;
    snprintf(name, sizeof name, "/proc/self/task/%ld/children", syscall(SYS_gettid));
    FILE *f = fopen(name, "r");
    if (f == NULL) return -1;
    if (fscanf(f, "%d", &child) != 1) child = 0;
    fclose(f);
    return child;
}

/* Returns the figure of a line of /proc/PID/limits; -1: none, or without limit. */
static long long limit_of(pid_t pid, const char *what)
{
    char name[64], line[256];
    long long value = -1;
    snprintf(name, sizeof name, "/proc/%d/limits", pid);
    FILE *f = fopen(name, "r");
    while (f != NULL && fgets(line, sizeof line, f) != NULL)
        if (strncmp(line, what, strlen(what)) == 0) sscanf(line + strlen(what), "%lld", &value);
    if (f != NULL) fclose(f);
    return value;
}

struct look {
    long long core, files, bytes, cpu_s;
    unsigned calls;
    pid_t child;
};

/* Keeps the child's limits once they are set, and stops the load. */
static int look_and_stop(void *ctx)
{
    struct look *look = ctx;
    look->child = child_of();
    look->calls++;
    if (look->child <= 0) return look->child < 0;
    look->files = limit_of(look->child, "Max open files");
    look->core = limit_of(look->child, "Max core file size");
    look->bytes = limit_of(look->child, "Max file size");
    look->cpu_s = limit_of(look->child, "Max cpu time");
    return look->bytes >= 0;
}

static void child_has_limits(void **state)
{
    (void)state;
    const struct scene_import_limits limits = {.memory_mib = 100, .time_s = 60, .files = 7};
    const struct scene_mesh_spec spec = {.file = endless_dae(), .scale = 1, .limits = &limits};
    struct look look = {.core = -1};
    const struct sh_report report = {.ctx = &look, .stop = look_and_stop};
    struct scene *s;
    struct sh_err err;
    int rc = scene_load(&spec, 1, 1e-3, &report, &s, &err);
    remove_endless();
    if (rc != SH_ESTOPPED) fail_msg("%d %s", rc, err.text);
    assert_string_equal(err.text, "stopped while loading; no scan was run");
    no_child_is_left();
    if (look.child < 0) skip(); /* a kernel without /proc/PID/task/TID/children */
    assert_int_equal(look.core, 0);
    assert_int_equal(look.files, 5 + 7); /* null thrice, the result, the messages */
    assert_int_equal(look.bytes, 100 << 20);
    assert_int_equal(look.cpu_s, 61);
}

static int say_child(void *ctx)
{
    pid_t child = child_of();
    if (child > 0 && limit_of(child, "Max file size") >= 0) {
        if (write(*(int *)ctx, &child, sizeof child) < 0) return 1;
    }
    return child < 0;
}

/* The parent is killed, so that it can't end the child. */
static void child_dies_with_its_parent(void **state)
{
    (void)state;
    const struct scene_mesh_spec spec = {.file = endless_dae(), .scale = 1};
    int said[2];
    pid_t child = 0;
    assert_int_equal(pipe(said), 0);
    pid_t parent = fork();
    if (parent == 0) {
        const struct sh_report report = {.ctx = &said[1], .stop = say_child};
        struct scene *s;
        scene_load(&spec, 1, 1e-3, &report, &s, NULL);
        _exit(0);
    }
    close(said[1]);
    ssize_t got = read(said[0], &child, sizeof child);
    close(said[0]);
    int ends = got == sizeof child ? pidfd_open(child, 0) : -1;
    kill(parent, SIGKILL);
    assert_int_equal(waitpid(parent, NULL, 0), parent);
    remove_endless();
    if (got == 0) skip(); /* a kernel without /proc/PID/task/TID/children */
    struct pollfd on = {.fd = ends, .events = POLLIN};
    assert_true(ends < 0 || poll(&on, 1, 240000) == 1); /* gone by then, or ends now */
    if (ends >= 0) close(ends);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hang_ends_in_time),
        cmocka_unit_test(memory_is_limited),
        cmocka_unit_test(crash_is_one_line),
        cmocka_unit_test(child_has_limits),
        cmocka_unit_test(child_dies_with_its_parent),
        cmocka_unit_test(signal_of_children_may_be_ignored),
        cmocka_unit_test(no_descriptors_are_left),
        cmocka_unit_test(gltf_of_old_gets_assimp_here),
        cmocka_unit_test(warnings_are_counted),
        cmocka_unit_test(limit_of_the_user_is_named),
        cmocka_unit_test(skins_of_old_gltf_are_reported),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
