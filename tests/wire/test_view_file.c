/* SPDX-License-Identifier: MIT */
/* These tests run `scanhead view` through the real program. The page gets the same figures over HTTP as `scanhead
 * record` makes of the same recording. The command's end and taken ports are tested, too. The recording is a sphere in
 * a closed room, whose mesh has no hole. */
#include <netinet/in.h>

#include "core/bytes.h"
#include "tests/wire/room.h"

/* A pole is one shot. */
enum { RINGS = 19, STEPS = 36, N_POINTS = 2 + (RINGS - 2) * STEPS, N_FACES = 2 * (RINGS - 2) * STEPS };

static const char SPHERE[] = "head: {profile: sphere, step_deg: 10}\n"
                             "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
                             "stations:\n  - {position_m: [0.31, -0.42, 0.17], heading_deg: 30}\n"
                             "output: {layout: polar}\n";

static struct wire *wire;
static char stream[128], endpoint[128];
static pid_t viewer;

/* Runs `record` on the recording into NAME, with up to four more arguments. */
static const char *record_again(const char *name, const char *const *more)
{
    static char to[128];
    const char *args[12] = {"record", stream, "--quiet", "--ascii", "-o", to};
    snprintf(to, sizeof to, "%s", wire_path(wire, name));
    for (int n = 6; *more != NULL; n++)
        args[n] = *more++;
    wire_run(wire, args, 0);
    return to;
}

/* Starts `view FILE` and reads its ready line, which names the endpoint. */
static void start(const char *file)
{
    static const char key[] = "\"endpoint\":\"";
    const char *const args[] = {"view", file, "--ready-fd", "3", NULL};
    char line[512] = "";
    size_t n = 0;
    int ready[2];
    assert_int_equal(pipe2(ready, O_CLOEXEC), 0);
    viewer = wire_spawn(wire, args, "view.out", "view.err", ready[1]);
    close(ready[1]);
    for (ssize_t got = 1; got > 0; n += (size_t)(got > 0 ? got : 0)) {
        struct pollfd slot = {.fd = ready[0], .events = POLLIN};
        if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("no ready line within %d ms", DEADLINE_MS);
        got = read(ready[0], line + n, sizeof line - 1 - n);
    }
    close(ready[0]);
    const char *at = strstr(line, key);
    if (at == NULL) wire_show(wire, "view.err");
    assert_non_null(at);
    assert_int_equal(sscanf(at + sizeof key - 1, "%127[^\"]", endpoint), 1);
}

static void end(int signal_number)
{
    assert_int_equal(kill(viewer, signal_number), 0);
    assert_int_equal(wire_wait(wire, viewer), 0);
}

/* Returns the body of an answer; free() *whole. */
static char *get(const char *resource, int status, size_t *len, char **whole)
{
    char request[256], address[128];
    size_t n = 0, room = 1 << 20;
    int said = 0;
    snprintf(address, sizeof address, "%.*s", (int)strcspn(endpoint + strlen("http://"), "/"),
             endpoint + strlen("http://"));
    int fd = raw_connect(address);
    raw_send(fd, request,
             (size_t)snprintf(request, sizeof request, "GET %s HTTP/1.1\r\nHost: %s\r\nConnection: close\r\n\r\n",
                              resource, address));
    *whole = malloc(room);
    for (ssize_t got = 1; got > 0 && n + 1 < room; n += (size_t)(got > 0 ? got : 0))
        got = read(fd, *whole + n, room - 1 - n);
    close(fd);
    (*whole)[n] = '\0';
    char *body = strstr(*whole, "\r\n\r\n");
    assert_non_null(body);
    assert_int_equal(sscanf(*whole, "HTTP/1.1 %d", &said), 1);
    if (said != status) fail_msg("%s: %s", resource, *whole);
    *len = n - (size_t)(body + 4 - *whole);
    return body + 4;
}

/* ---- the contents of an answer */

struct answer {
    char *whole, *body;
    size_t len;
    uint32_t n, total;
    double origin_m[3];
};

static struct answer get_points(const char *resource)
{
    struct answer a;
    a.body = get(resource, 200, &a.len, &a.whole);
    assert_true(a.len >= 56);
    assert_memory_equal(a.body, "SHCL", 4);
    a.n = le_get32(a.body + 8);
    a.total = le_get32(a.body + 24);
    memcpy(a.origin_m, a.body + 32, sizeof a.origin_m); /* the tests run on little-endian machines */
    return a;
}

/* Returns a column's first value. */
static const char *column(const struct answer *a, const char *name)
{
    for (uint32_t i = 0; i < le_get32(a->body + 12); i++) {
        const char *row = a->body + 56 + 32 * i;
        if (strcmp(row, name) == 0) return a->body + le_get32(row + 28);
    }
    fail_msg("no column %s", name);
    return NULL;
}

static float float_of(const char *values, uint32_t i)
{
    float f;
    memcpy(&f, values + 4 * i, sizeof f);
    return f;
}

/* Writes x, y, z and range of point i. */
static void figures_of(const struct answer *a, uint32_t i, double v[4])
{
    const char *xyz = column(a, "xyz");
    for (uint32_t k = 0; k < 3; k++)
        v[k] = a->origin_m[k] + (double)float_of(xyz, 3 * i + k);
    v[3] = (double)float_of(column(a, "range"), i);
}

/* Each point is that of a .ply as text, whose rows begin with x, y, z, range. */
static void assert_same(const struct answer *a, const char *file)
{
    /* Floats within 16 m of the origin step by 1e-6 m; the text has six decimals. */
    const double tolerance_m = 2e-6;
    char *text = wire_read(file, NULL), *p = strstr(text, "end_header\n");
    assert_non_null(p);
    p += strlen("end_header\n");
    for (uint32_t i = 0; i < a->n; i++) {
        double v[4];
        figures_of(a, i, v);
        for (int k = 0; k < 4; k++)
            if (!(fabs(strtod(p, &p) - v[k]) <= tolerance_m)) fail_msg("point %u, column %d: %.9g", i, k, v[k]);
        p += strcspn(p, "\n") + 1;
    }
    assert_int_equal(*p, '\0');
    free(text);
}

/* ---- tests */

static void the_points(void **state)
{
    static const char *const none[] = {NULL};
    size_t len;
    char *whole;
    (void)state;
    const char *head = get("/head", 200, &len, &whole);
    char points[32];
    snprintf(points, sizeof points, "\"points\":%d,", N_POINTS);
    if (strstr(head, points) == NULL) fail_msg("%s", head);
    assert_non_null(strstr(head, "\"shots_without_echo\":0,"));
    assert_non_null(strstr(head, "\"frame\":\"scene\""));
    assert_non_null(strstr(head, "\"complete\":true"));
    assert_non_null(strstr(head, "\"x_m\":0.31,\"y_m\":-0.42,\"z_m\":0.17,"));
    assert_non_null(strstr(head, WALLS[0]));
    free(whole);
    struct answer all = get_points("/cloud");
    assert_int_equal(all.n, N_POINTS);
    assert_same(&all, record_again("again.ply", none));
    for (uint32_t i = 0; i < all.n; i++) { /* each is on a wall, to a millimetre on the wire */
        double v[4], nearest = 1;
        figures_of(&all, i, v);
        for (int k = 0; k < 3; k++)
            nearest = fmin(nearest, fmin(fabs(v[k] - ROOM_MIN[k]), fabs(ROOM_MAX[k] - v[k])));
        assert_true(nearest < 1e-3);
    }
    struct answer some = get_points("/cloud?first=10&count=7&every=80");
    assert_int_equal(some.n, 7);
    assert_memory_equal(column(&some, "xyz") + 12 * 6, column(&all, "xyz") + 12 * (10 + 6 * 80), 12);
    free(all.whole);
    free(some.whole);
}

static uint32_t faces_of_record(const char *factor)
{
    const char *const more[] = {"--mesh", "--long-edge", factor, NULL};
    unsigned n = 0;
    char *text = wire_read(record_again("mesh.ply", more), NULL), *at = strstr(text, "element face ");
    assert_non_null(at);
    assert_int_equal(sscanf(at, "element face %u", &n), 1);
    free(text);
    return n;
}

static void the_mesh(void **state)
{
    static const char *const factor[] = {"0", "0.5", "1", "1.5", "2", "3"};
    size_t len;
    char *whole, *body;
    uint32_t last = 0;
    (void)state;
    body = get("/mesh?scan=1", 200, &len, &whole);
    assert_memory_equal(body, "SHMS", 4);
    const uint32_t n = le_get32(body + 8);
    assert_int_equal(n, N_FACES);
    assert_int_equal(le_get32(body + 28), N_FACES / 2 * 3); /* edges of a closed surface */
    assert_int_equal(len, 40 + 16 * n);
    const char *ratio = body + 40 + 12 * (size_t)n;
    for (uint32_t i = 0; i < 3 * n; i++)
        assert_true(le_get32(body + 40 + 4 * i) < N_POINTS);
    for (uint32_t i = 1; i < n; i++)
        assert_true(float_of(ratio, i - 1) <= float_of(ratio, i));
    for (size_t k = 0; k < sizeof factor / sizeof factor[0]; k++) {
        uint32_t kept = 0;
        while (kept < n && (k == 0 || float_of(ratio, kept) <= strtof(factor[k], NULL)))
            kept++;
        assert_int_equal(kept, faces_of_record(factor[k]));
        if (k > 1) assert_true(kept > last); /* each factor shows something */
        last = kept;
    }
    free(whole);
    body = get("/mesh?scan=1&first=1200&count=100", 200, &len, &whole);
    assert_int_equal(le_get32(body + 8), N_FACES - 1200);
    free(whole);
}

static void points_spread_over_it(void **state)
{
    static const char *const more[] = {"--sparse", "5", "--long-edge", "2", NULL};
    (void)state;
    struct answer a = get_points("/sparse?per_m2=5&long_edge=2");
    assert_true(a.n > 100 && a.n == a.total);
    assert_same(&a, record_again("sparse.ply", more));
    struct answer rest = get_points("/sparse?per_m2=5&long_edge=2&first=100");
    assert_int_equal(rest.n, a.n - 100);
    assert_memory_equal(column(&rest, "xyz"), column(&a, "xyz") + 1200, 12);
    free(a.whole);
    free(rest.whole);
}

static void what_is_refused(void **state)
{
    size_t len;
    char *whole, port[16];
    (void)state;
    get("/scene", 404, &len, &whole);
    free(whole);
    assert_non_null(strstr(get("/mesh?scan=2", 400, &len, &whole), "from 1 to 1"));
    free(whole);
    assert_non_null(strstr(get("/sparse?per_m2=1e9", 400, &len, &whole), "4000000 points"));
    free(whole);
    assert_non_null(strstr(get("/", 200, &len, &whole), "<html"));
    free(whole);
    snprintf(port, sizeof port, "%d", endpoint_port(endpoint));
    const char *const args[] = {"view", stream, "--port", port, NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 2);
    char *text = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(text, "in use"));
    free(text);
    text = wire_read(wire_path(wire, "view.out"), NULL);
    text[strcspn(text, "\n")] = '\0';
    assert_string_equal(text, endpoint); /* on standard output, too */
    free(text);
}

static void both_signals_end_it(void **state)
{
    (void)state;
    end(SIGTERM);
    start(stream);
    end(SIGINT);
}

static int setup(void **state)
{
    if (wire_setup(state) != 0) return -1;
    wire = *state;
    room_write(wire);
    char config[128];
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "sphere.yaml", SPHERE));
    snprintf(stream, sizeof stream, "%s", wire_path(wire, "sphere.shs"));
    const char *const args[] = {"record", config, "--quiet", "-o", stream, NULL};
    wire_run(wire, args, 0);
    start(stream);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_points),
        cmocka_unit_test(the_mesh),
        cmocka_unit_test(points_spread_over_it),
        cmocka_unit_test(what_is_refused),
        cmocka_unit_test(both_signals_end_it),
    };
    return cmocka_run_group_tests(tests, setup, wire_teardown);
}
