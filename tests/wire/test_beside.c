/* SPDX-License-Identifier: MIT */
/* A personality's link does not change the native stream: its hash is the same with it and without. The personality's
 * ports survive clients that come, send half a word and go. */
#include "tests/common/thorough.h"
#include "tests/wire/wire.h"

#define CLIENTS thorough(10000, 2000)

struct personality {
    const char *config, *asks; /* asks: the request after which it sends all that it has; NULL: it sends by itself */
    const char *ptys[2];       /* keys of terminals' paths, or NULL */
    int native;                /* link */
    const char *without[8];    /* keys that take the personality away */
};
static const struct personality HOKUYO = {"config/hokuyo.yaml",
                                          "BM\nMD0000108001000\n",
                                          {"links.1.path", "links.3.path"},
                                          2,
                                          {"links.0.protocol=native", "links.1.protocol=native"}};
static const struct personality SICK = {"config/sick.yaml",
                                        "\2sEN LMDscandata 1\3",
                                        {"links.1.path", "links.3.path"},
                                        2,
                                        {"links.0.protocol=native", "links.1.protocol=native"}};
static const struct personality VELODYNE = {"config/velodyne.yaml",
                                            NULL,
                                            {"links.4.path"},
                                            3,
                                            {"links.0.type=tcp", "links.1.type=tcp", "links.0.protocol=native",
                                             "links.1.protocol=native", "links.2.protocol=native"}};

static struct head start(struct wire *wire, const struct personality *p, int with, int fast, const char *const *keys)
{
    static char path[2][400];
    const char *args[WIRE_MAX_ARGS] = {"--set", IFC_BY_ASSIMP};
    int n = 2;
    for (int i = 0; i < 2 && p->ptys[i] != NULL; i++) {
        snprintf(path[i], sizeof path[i], "%s=%s", p->ptys[i], wire_path(wire, p->ptys[i]));
        args[n++] = "--set";
        args[n++] = path[i];
    }
    for (int i = 0; !with && i < 8 && p->without[i] != NULL; i++) {
        args[n++] = "--set";
        args[n++] = p->without[i];
    }
    if (fast) {
        args[n++] = "--pace";
        args[n++] = "fast";
    }
    for (; *keys != NULL; keys++) {
        args[n++] = "--set";
        args[n++] = *keys;
    }
    args[n] = NULL;
    return head_start(wire, p->config, args);
}

/* Starts a child that asks, which starts the scan, and then takes all that comes until the head is gone. */
static pid_t ask_and_drain(struct wire *wire, const char *endpoint, const char *asks)
{
    static char bytes[1 << 16];
    pid_t pid = wire_fork(wire);
    if (pid != 0) return pid;
    size_t sum = 0;
    int fd = raw_connect(endpoint);
    raw_send(fd, asks, strlen(asks));
    for (ssize_t n; (n = read(fd, bytes, sizeof bytes)) > 0;)
        sum += (size_t)n;
    _exit(sum < 100000); /* scans came, not only replies */
}

/* Scans so many frames as fast as the head computes. The head waits for each client meanwhile. */
static void scan(struct wire *wire, const struct personality *p, int with, const char *frames, char hex[65])
{
    int udp[2];
    char port[2][64];
    for (int i = 0; i < 2; i++) {
        int number;
        udp[i] = wire_bind(SOCK_DGRAM, &number);
        snprintf(port[i], sizeof port[i], "links.%d.port=%d", i, p->asks == NULL && with ? number : 0);
    }
    const char *keys[] = {port[0], "noise.range=on", "head.start=off", frames, NULL, NULL, NULL};
    if (p->asks == NULL) keys[4] = port[1], keys[5] = "links.2.port=0";
    struct head head = start(wire, p, with, 1, keys);
    struct scanhead *sh = client_open(head_link(&head, p->native));
    struct scanhead_frame frame;
    pid_t drain = 0;
    client_wait_state(sh, "idle");
    scanhead_hash_start(sh);
    /* A client that asks for scans asks before the scan begins: the head waits for a client, but not for one that is
     * yet to come. */
    if (with && p->asks != NULL)
        drain = ask_and_drain(wire, head_link(&head, 0), p->asks);
    else
        client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    if (drain != 0) assert_int_equal(wire_wait(wire, drain), 0);
    stats_hash(wire, hex);
    close(udp[0]);
    close(udp[1]);
}

static void check_hash(struct wire *wire, const struct personality *p, const char *frames)
{
    char with[65], without[65];
    scan(wire, p, 1, frames, with);
    scan(wire, p, 0, frames, without);
    assert_string_equal(with, without);
}

static void test_hash_hokuyo(void **state)
{
    check_hash(*state, &HOKUYO, "head.frames=400");
}

static void test_hash_sick(void **state)
{
    check_hash(*state, &SICK, "head.frames=150");
}

static void test_hash_velodyne(void **state)
{
    check_hash(*state, &VELODYNE, "head.frames=10");
}

struct crowd {
    const struct personality *p;
    const char *half, *ask, *answer; /* half: sent by each client before it goes; ask: sent after all of them */
};

/* The clients come one after the other. */
static pid_t crowd(struct wire *wire, const char *endpoint, const char *half)
{
    char rest[256];
    pid_t pid = wire_fork(wire);
    if (pid != 0) return pid;
    for (int i = 0; i < CLIENTS; i++) {
        int fd = raw_connect(endpoint);
        raw_send(fd, half, strlen(half));
        shutdown(fd, SHUT_WR);
        while (read(fd, rest, sizeof rest) > 0) /* until the head has closed it, so that no client waits for it */
            continue;
        close(fd);
    }
    _exit(0);
}

static void expect_answer(const char *endpoint, const struct crowd *c)
{
    char reply[64] = "";
    int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    while (strncmp(reply, c->answer, strlen(c->answer)) != 0) { /* the last ones may still be in the way */
        if (wire_now_ms() > end_ms) fail_msg("no answer: %s", reply);
        int fd = raw_connect(endpoint);
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        (void)!write(fd, c->ask, strlen(c->ask));
        ssize_t n = poll(&slot, 1, 1000) == 1 ? read(fd, reply, sizeof reply - 1) : 0;
        reply[n > 0 ? n : 0] = '\0';
        close(fd);
    }
}

/* Thousands of clients come to each head. Afterwards the heads answer as if none had been there. */
static void test_crowds(void **state)
{
    (void)state;
    static const struct crowd crowds[2] = {{&HOKUYO, "MD00001", "QT\n", "QT\n00P\n\n"},
                                           {&SICK, "\2\2\2\2sRN", "\2sRN SCdevicestate\3", "\2sRA SCdevicestate 1\3"}};
    const char *const keys[] = {"links.0.port=0", NULL};
    struct wire *wire[2];
    struct head head[2];
    pid_t clients[2];
    for (int i = 0; i < 2; i++) {
        assert_int_equal(wire_setup((void **)&wire[i]), 0);
        head[i] = start(wire[i], crowds[i].p, 1, 0, keys);
        clients[i] = crowd(wire[i], head_link(&head[i], 0), crowds[i].half);
    }
    for (int i = 0; i < 2; i++) {
        int status; /* longer than wire_wait waits */
        assert_int_equal(waitpid(clients[i], &status, 0), clients[i]);
        assert_int_equal(status, 0);
        wire[i]->n_children = 1; /* the head, which came first */
        expect_answer(head_link(&head[i], 0), &crowds[i]);
        head_end(&head[i], SIGTERM);
        assert_int_equal(wire_teardown((void **)&wire[i]), 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_hash_hokuyo, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_hash_sick, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_hash_velodyne, wire_setup, wire_teardown),
        cmocka_unit_test(test_crowds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
