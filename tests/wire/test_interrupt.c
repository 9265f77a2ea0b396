/* SPDX-License-Identifier: MIT */
/* SIGTERM while the head loads ends it within half a second, in one line, at any step of loading. */
#include <sys/inotify.h>
#include <sys/resource.h>

#include "tests/common/generate.h"
#include "tests/wire/wire.h"

/* Above a million triangles the building of the BVH is announced. */
enum { TRIANGLES = 1010000 };

/* 0.5 s is promised, and 0.02 to 0.12 s was measured on two idle processors. The test counts processor time, so that
 * a busy machine changes nothing: half a second of both processors. */
enum { MOST_MS = 1000 };

static void put(FILE *f, const void *data, size_t size)
{
    assert_int_equal(fwrite(data, 1, size, f), size);
}

static void write_ply(FILE *f, const struct scene *s)
{
    static const unsigned char three = 3;
    fprintf(f,
            "ply\nformat binary_little_endian 1.0\nelement vertex %u\nproperty double x\nproperty double y\n"
            "property double z\nelement face %u\nproperty list uchar uint vertex_indices\nend_header\n",
            s->n_vertices, s->n_triangles);
    put(f, s->vertex_m, s->n_vertices * sizeof *s->vertex_m);
    for (uint32_t i = 0; i < s->n_triangles; i++) {
        put(f, &three, 1);
        put(f, s->triangle[i], sizeof *s->triangle);
    }
}

static void write_collada(FILE *f, const struct scene *s)
{
    const uint32_t n = s->n_triangles;
    fprintf(f,
            "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
            "<library_geometries><geometry id=\"g\"><mesh><source id=\"p\"><float_array id=\"pa\" count=\"%u\">",
            3 * s->n_vertices);
    for (uint32_t i = 0; i < s->n_vertices; i++)
        fprintf(f, "%.3f %.3f %.3f ", s->vertex_m[i][0], s->vertex_m[i][1], s->vertex_m[i][2]);
    fprintf(f,
            "</float_array><technique_common><accessor source=\"#pa\" count=\"%u\" stride=\"3\">"
            "<param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/>"
            "</accessor></technique_common></source><vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/>"
            "</vertices><triangles count=\"%u\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>",
            s->n_vertices, n);
    for (uint32_t i = 0; i < n; i++)
        fprintf(f, "%u %u %u ", s->triangle[i][0], s->triangle[i][1], s->triangle[i][2]);
    fputs("</p></triangles></mesh></geometry></library_geometries><library_visual_scenes><visual_scene id=\"s\">"
          "<node><instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes>"
          "<scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>",
          f);
}

static const char *write_mesh(struct wire *wire, const char *name, void (*write)(FILE *f, const struct scene *s))
{
    static struct scene *scene;
    struct sh_err err;
    char text[512];
    const double centre_m[2] = {0, 0};
    if (scene == NULL && generate_terrain(TRIANGLES, 200, 1, centre_m, 1, &scene, &err) != SH_OK)
        fail_msg("%s", err.text);
    FILE *f = fopen(wire_path(wire, name), "wb");
    assert_non_null(f);
    write(f, scene);
    assert_int_equal(fclose(f), 0);
    snprintf(text, sizeof text,
             "head: {profile: riegl-vz400i}\nscene:\n  tolerance_m: 0.001\n  meshes:\n"
             "    - {file: %s, up: z, scale: 1}\nstations:\n  - {position_m: [0, 0, 5]}\n"
             "links: [{type: \"null\"}]\n",
             name);
    return wire_write_text(wire, "config.yaml", text);
}

/* Waits for a text on the program's standard error, a FIFO. All text so far stays in `got`. */
static void wait_for(int fd, const char *text, char *got, size_t room)
{
    size_t n = 0;
    got[0] = '\0';
    while (strstr(got, text) == NULL) {
        struct pollfd on = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&on, 1, DEADLINE_MS), 1);
        ssize_t some = read(fd, got + n, room - 1 - n);
        assert_true(some > 0);
        n += (size_t)some;
        got[n] = '\0';
    }
}

/* The program's standard error is open at both ends, so that neither open waits. */
static int make_err(struct wire *wire)
{
    assert_int_equal(mkfifo(wire_path(wire, "err"), 0600), 0);
    int fd = open(wire_path(wire, "err"), O_RDWR | O_CLOEXEC);
    assert_true(fd >= 0);
    return fd;
}

/* Returns the processor time of a process so far, with its children that have ended. */
static int64_t taken_ms(const char *pid)
{
    char name[64], text[1024];
    unsigned long user, kernel, user_of_past, kernel_of_past;
    snprintf(name, sizeof name, "/proc/%.20s/stat", pid);
    FILE *f = fopen(name, "r");
    if (f == NULL) return 0; /* it has just ended */
    assert_non_null(fgets(text, sizeof text, f));
    fclose(f);
    assert_int_equal(sscanf(strrchr(text, ')'), ") %*c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %lu %lu %lu %lu", &user,
                            &kernel, &user_of_past, &kernel_of_past),
                     4);
    return (int64_t)(user + kernel + user_of_past + kernel_of_past) * 1000 / sysconf(_SC_CLK_TCK);
}

/* This adds the child that reads for it, if there is one. */
static int64_t all_taken_ms(pid_t pid)
{
    char name[64], number[32] = "";
    snprintf(name, sizeof name, "/proc/%d/task/%d/children", (int)pid, (int)pid);
    FILE *f = fopen(name, "r");
    assert_non_null(f);
    const int n = fscanf(f, "%20s", number);
    fclose(f);
    int64_t sum_ms = n == 1 ? taken_ms(number) : 0;
    snprintf(number, sizeof number, "%d", (int)pid);
    return sum_ms + taken_ms(number);
}

/* Returns the processor time of all processes that were waited for, with their children. */
static int64_t past_ms(void)
{
    struct rusage past;
    getrusage(RUSAGE_CHILDREN, &past);
    return (past.ru_utime.tv_sec + past.ru_stime.tv_sec) * 1000 +
           (past.ru_utime.tv_usec + past.ru_stime.tv_usec) / 1000;
}

static void end_it(struct wire *wire, pid_t pid, int err)
{
    char got[4096];
    const int64_t before_ms = past_ms() + all_taken_ms(pid), begin_ms = wire_now_ms();
    kill(pid, SIGTERM);
    int status = wire_wait(wire, pid);
    assert_true(wire_now_ms() - begin_ms < SOON_MS); /* it does not wait either, however busy the machine is */
    const int64_t took_ms = past_ms() - before_ms;
    assert_int_equal(status, 1);
    wait_for(err, "scanhead: stopped while loading; no scan was run\n", got, sizeof got);
    if (took_ms > MOST_MS) fail_msg("SIGTERM took %lld ms", (long long)took_ms);
    print_message("# SIGTERM took %lld ms\n", (long long)took_ms);
    close(err);
}

static pid_t start(struct wire *wire, const char *config)
{
    char path[352];
    snprintf(path, sizeof path, "%s", config);
    const char *const args[] = {"run", path, NULL};
    return wire_spawn(wire, args, "out", "err", -1);
}

static void interrupted_when_it_says(struct wire *wire, const char *config, const char *says)
{
    char got[4096];
    int err = make_err(wire);
    pid_t pid = start(wire, config);
    wait_for(err, says, got, sizeof got);
    end_it(wire, pid, err);
}

static void test_while_assimp_reads(void **state)
{
    const char *config = write_mesh(*state, "big.dae", write_collada);
    interrupted_when_it_says(*state, config, "reading ");
}

static void test_while_the_bvh_is_built(void **state)
{
    const char *config = write_mesh(*state, "big.ply", write_ply);
    interrupted_when_it_says(*state, config, "building the BVH");
}

/* Our own readers print nothing in the first second, so the signal comes when the file is opened. */
static void test_while_a_ply_is_read(void **state)
{
    struct wire *wire = *state;
    char config[352];
    snprintf(config, sizeof config, "%s", write_mesh(wire, "big.ply", write_ply));
    int watch = inotify_init1(IN_CLOEXEC), err = make_err(wire);
    assert_true(inotify_add_watch(watch, wire_path(wire, "big.ply"), IN_OPEN) >= 0);
    pid_t pid = start(wire, config);
    struct pollfd on = {.fd = watch, .events = POLLIN};
    assert_int_equal(poll(&on, 1, DEADLINE_MS), 1);
    close(watch);
    end_it(wire, pid, err);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_while_assimp_reads, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_while_a_ply_is_read, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_while_the_bvh_is_built, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("interrupt", tests, NULL, NULL);
}
