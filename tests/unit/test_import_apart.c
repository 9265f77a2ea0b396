/* SPDX-License-Identifier: MIT */
/* Import by Assimp in a process of its own: what comes back is not trusted; limits, crashes and the end of
 * either process are one line, and nothing stays behind. */
#include <dlfcn.h>
#include <errno.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/pidfd.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>

#include <assimp/version.h>

#include "core/assimp_lib.h"
#include "core/import/import.h"
#include "tests/common/collada.h"
#include "tests/common/thorough.h"
#include "tests/unit/scene_files.h"

#define HOUSE "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc"

/* ---- the result */

static void *copy_of(const void *data, size_t size)
{
    void *copy = malloc(size);
    assert_non_null(copy);
    return memcpy(copy, data, size);
}

/* Two triangles of two surfaces, one with a texture that came within the file. */
static struct scene *small_scene(void)
{
    static const double vertex_m[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0.25}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 3}};
    static const uint16_t label[2] = {0, 1};
    static const float uv[2][3][2] = {{{0, 0}, {1, 0}, {1, 1}}, {{NAN, NAN}, {NAN, NAN}, {NAN, NAN}}};
    struct scene *s = calloc(1, sizeof *s);
    assert_non_null(s);
    *s = (struct scene){.n_vertices = 4, .n_triangles = 2, .n_surfaces = 2, .n_meshes = 1, .n_textures = 1};
    s->vertex_m = copy_of(vertex_m, sizeof vertex_m);
    s->triangle = copy_of(triangle, sizeof triangle);
    s->label = copy_of(label, sizeof label);
    s->uv = copy_of(uv, sizeof uv);
    s->surface = calloc(2, sizeof *s->surface);
    s->texture = calloc(1, sizeof *s->texture);
    assert_true(s->surface != NULL && s->texture != NULL);
    s->surface[0] =
        (struct scene_surface){"wall", "paint", {0.5f, 0.25f, 1.0f}, .has_colour = 1, .texture = 1, .solid = 0.5f};
    s->surface[1] = (struct scene_surface){.object = "floor"};
    s->texture[0] = (struct scene_texture){.file = strdup("some/a.dae*0"), .bytes = copy_of("pixels", 6), .n_bytes = 6};
    s->counts.zero_area = 3;
    return s;
}

/* As bytes. */
static size_t write_result(uint8_t *bytes, size_t room)
{
    struct sh_err err;
    int fd = memfd_create("result", MFD_CLOEXEC);
    struct scene *s = small_scene();
    assert_int_equal(import_result_write(s, fd, &err), SH_OK);
    scene_free(s);
    ssize_t n = pread(fd, bytes, room, 0);
    assert_true(n > 0 && (size_t)n < room);
    close(fd);
    return (size_t)n;
}

static int read_result(const uint8_t *bytes, size_t n, struct scene_build *b, struct sh_err *err)
{
    static const struct scene_mesh_spec spec = {.file = "some/a.dae", .scale = 1, .textures = 1};
    int fd = memfd_create("result", MFD_CLOEXEC);
    assert_int_equal(write(fd, bytes, n), n);
    assert_int_equal(build_init(b, 1e-3, NULL, err), SH_OK);
    build_begin_file(b, &spec);
    int rc = import_result_read(b, fd, err);
    close(fd);
    return rc;
}

static void result_comes_back(void **state)
{
    (void)state;
    uint8_t bytes[4096];
    struct scene_build b;
    struct sh_err err = {0};
    struct scene *want = small_scene();
    size_t n = write_result(bytes, sizeof bytes);
    if (read_result(bytes, n, &b, &err) != SH_OK) fail_msg("%s", err.text);
    const struct scene *s = b.scene;
    assert_true(s->n_vertices == 4 && s->n_triangles == 2 && s->n_surfaces == 2 && s->n_textures == 1);
    assert_memory_equal(s->vertex_m, want->vertex_m, 4 * sizeof *s->vertex_m);
    assert_memory_equal(s->triangle, want->triangle, 2 * sizeof *s->triangle);
    assert_memory_equal(s->label, want->label, 2 * sizeof *s->label);
    assert_memory_equal(s->uv, want->uv, 2 * sizeof *s->uv);
    for (int i = 0; i < 2; i++) {
        assert_string_equal(s->surface[i].object, want->surface[i].object);
        assert_string_equal(s->surface[i].material, want->surface[i].material);
        assert_int_equal(s->surface[i].texture, want->surface[i].texture);
        assert_int_equal(s->surface[i].has_colour, want->surface[i].has_colour);
    }
    assert_memory_equal(s->surface[0].colour, want->surface[0].colour, sizeof s->surface[0].colour);
    assert_string_equal(s->texture[0].file, "some/a.dae*0");
    assert_true(s->texture[0].n_bytes == 6 && memcmp(s->texture[0].bytes, "pixels", 6) == 0);
    assert_int_equal(s->counts.zero_area, 3);
    scene_free(want);
    build_release(&b);
}

/* What every user of a scene relies on. */
static void check_scene(const struct scene *s)
{
    for (uint32_t i = 0; i < s->n_vertices; i++)
        for (int k = 0; k < 3; k++)
            assert_true(fabs(s->vertex_m[i][k]) <= BUILD_MAX_COORDINATE_M);
    for (uint32_t i = 0; i < s->n_triangles; i++) {
        assert_true(s->label[i] < s->n_surfaces);
        for (int c = 0; c < 3; c++)
            assert_true(s->triangle[i][c] < s->n_vertices && (s->uv == NULL || !isinf(s->uv[i][c][0])));
    }
    for (uint32_t i = 0; i < s->n_surfaces; i++) {
        assert_true(strnlen(s->surface[i].object, SCENE_NAME_LEN) < SCENE_NAME_LEN);
        assert_true(s->surface[i].texture <= s->n_textures);
    }
}

static unsigned n_refused;

static void try_result(const uint8_t *bytes, size_t n)
{
    struct scene_build b;
    struct sh_err err = {0};
    if (read_result(bytes, n, &b, &err) == SH_OK) {
        check_scene(b.scene);
    } else {
        n_refused++;
        if (strstr(err.text, "some/a.dae") != err.text || strchr(err.text, '\n') != NULL) fail_msg("'%s'", err.text);
    }
    build_release(&b);
}

/* The middle of what a name leaves free: any of it is like the rest. */
static int is_padding(const uint8_t *bytes, size_t at, size_t n)
{
    static const uint8_t none[36];
    return at >= 16 && at + 20 <= n && memcmp(bytes + at - 16, none, sizeof none) == 0;
}

/* Every word of it with every value that means something: counts too large, indices out of range, NaN, infinite,
 * names without an end; and many lengths. */
static void broken_result_is_refused(void **state)
{
    (void)state;
    static const uint32_t values[] = {0, 0x7fffffff, 0xffffffff, 0x7ff00000, 0x41414141};
    static uint8_t bytes[4096], broken[4096];
    size_t n = write_result(bytes, sizeof bytes);
    n_refused = 0;
    for (size_t at = 0; at + 4 <= n; at += SANITIZED ? 28 : 4) {
        if (is_padding(bytes, at, n)) continue;
        for (size_t i = 0; i < sizeof values / sizeof values[0]; i++) {
            memcpy(broken, bytes, n);
            memcpy(broken + at, &values[i], 4);
            try_result(broken, n);
        }
    }
    assert_true(n_refused > (unsigned)fewer(100)); /* of 700; most of the words are of names, which may be anything */
    n_refused = 0;
    for (size_t len = 0; len < n; len += SANITIZED ? 91 : 13)
        try_result(bytes, len);
    assert_int_equal(n_refused, SANITIZED ? (n + 90) / 91 : (n + 12) / 13); /* too short, all of them */
    memcpy(broken, bytes, n);
    n_refused = 0;
    try_result(broken, n + 4);
    assert_int_equal(n_refused, 1);
}

/* A name that has no end, at the place where it stands. */
static void names_have_an_end(void **state)
{
    (void)state;
    static uint8_t bytes[4096];
    struct scene_build b;
    struct sh_err err;
    size_t n = write_result(bytes, sizeof bytes);
    uint8_t *name = memmem(bytes, n, "floor", 6);
    assert_non_null(name);
    memset(name, 'a', SCENE_NAME_LEN);
    assert_int_equal(read_result(bytes, n, &b, &err), SH_EINPUT);
    assert_string_equal(err.text,
                        "some/a.dae: what Assimp gave back makes no sense: a name of surface 1; the file is broken");
    build_release(&b);
}

/* ---- the process. Assimp hangs for a mesh of this name: the loader of libraries is the test's own. */

#define ENDLESS "endless.dae"

static const struct aiScene *(*read_file)(const char *, unsigned, struct aiFileIO *, const struct aiPropertyStore *);

static const struct aiScene *hang_or_read(const char *file, unsigned flags, struct aiFileIO *io,
                                          const struct aiPropertyStore *options)
{
    while (strstr(file, ENDLESS) != NULL)
        pause();
    return read_file(file, flags, io, options);
}

int late_load(enum late_library which, const char *const *name, void *calls, size_t n, struct sh_err *err)
{
    (void)err;
    assert_int_equal(which, LATE_assimp);
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
    if (strstr(err.text, "endless.dae: Assimp has not read it within 0.15 s (scene.import_s)") == NULL)
        fail_msg("%s", err.text);
    no_child_is_left();
}

/* As a program may be started: then there is no status of the child, and what it wrote counts. */
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
    assert_null(strstr(err.text, "makes no sense")); /* what the child said */
    signal(SIGCHLD, was);
    unlink(path);
}

/* The file is not to blame where the process has no descriptors left. */
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

/* Assimp 5.2 goes on at the word that is no number, and keeps an index each time. */
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
    if (strstr(err.text, "grows.dae: Assimp takes more than 32 MiB to read it (scene.import_memory_mib)") == NULL)
        fail_msg("%s", err.text);
    no_child_is_left();
}

/* The house with one record of another type: Assimp takes it for a point all the same. */
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
    const char *want = crashes ? "x.ifc: Assimp crashed on it (SIGSEGV)" : "x.ifc: Obj type is nullptr";
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

/* ---- looking at the child while it reads */

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

/* The figure of a line of /proc/PID/limits; -1: none, or without limit. */
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

/* Once its limits are set, they are kept, and the load is stopped. */
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
    assert_string_equal(err.text, "interrupted while loading; nothing ran");
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

/* Killed, so that it can do nothing about it. */
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
        cmocka_unit_test(result_comes_back),
        cmocka_unit_test(broken_result_is_refused),
        cmocka_unit_test(names_have_an_end),
        cmocka_unit_test(hang_ends_in_time),
        cmocka_unit_test(memory_is_limited),
        cmocka_unit_test(crash_is_one_line),
        cmocka_unit_test(child_has_limits),
        cmocka_unit_test(child_dies_with_its_parent),
        cmocka_unit_test(signal_of_children_may_be_ignored),
        cmocka_unit_test(no_descriptors_are_left),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
