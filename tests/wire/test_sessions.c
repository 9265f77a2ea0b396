/* SPDX-License-Identifier: MIT */
/* Sessions of protocols that are not native. The sessions don't change the stream, and are part of journals. They hold
 * the head back in pace fast, and lose whole units where a client doesn't read. */
#include "tests/common/thorough.h"
#include "tests/wire/room.h"

static const char SCIP_LINKS[] = "links: [{type: tcp, port: 0, protocol: scip}, {type: pty, path: native}]\n";
static const char START[] = "time: {epoch: 2026-01-01T00:00:00Z}\n";

static struct room_config planar(const char *links)
{
    return (struct room_config){
        .profile = "hokuyo-utm-30lx", .prr_hz = 57600, .lines_hz = 40, .links = links, .more = START};
}

/* ---- a client of SCIP: lines up to an empty one */

struct client {
    int fd;
    char bytes[1 << 16];
    size_t len;
};

static void say(struct client *c, const char *text)
{
    raw_send(c->fd, text, strlen(text));
}

/* Returns the next answer without its empty line, NUL-terminated and good until the next call; NULL: the connection is
 * over. */
static const char *answer(struct client *c)
{
    static char text[1 << 16];
    for (;;) {
        char *end = memmem(c->bytes, c->len, "\n\n", 2);
        if (end != NULL) {
            size_t n = (size_t)(end - c->bytes) + 2;
            memcpy(text, c->bytes, n - 2);
            text[n - 2] = '\0';
            memmove(c->bytes, c->bytes + n, c->len - n);
            c->len -= n;
            return text;
        }
        struct pollfd slot = {.fd = c->fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        assert_true(c->len < sizeof c->bytes);
        ssize_t got = read(c->fd, c->bytes + c->len, sizeof c->bytes - c->len);
        if (got <= 0) return NULL;
        c->len += (size_t)got;
    }
}

static const char *ask(struct client *c, const char *text)
{
    say(c, text);
    return answer(c);
}

static void expect(struct client *c, const char *text, const char *begin)
{
    const char *said = ask(c, text);
    assert_non_null(said);
    if (strncmp(said, begin, strlen(begin)) != 0) fail_msg("%s: %s", text, said);
}

/* Waits for the end of the head's boot, which it shows by accepting a measurement. */
static void laser_on(struct client *c)
{
    while (strncmp(ask(c, "BM\n"), "BM\n1", 4) == 0)
        continue;
}

/* The head boots for 0.2 s. */
static void wait_for_scan(const char *at)
{
    static struct client c;
    c = (struct client){.fd = raw_connect(at)};
    laser_on(&c);
    expect(&c, "GD0000108000\n", "GD0000108000\n00P");
    close(c.fd);
}

/* ---- the stream is the same with and without them */

/* A head runs alone on a null link, then with other protocols beside it. */
static void expect_same(struct wire *wire, struct room_config config, const char *beside)
{
    static const char *const args[] = {"--start",
                                       "--pace",
                                       "fast",
                                       "--duration",
                                       "1",
                                       "--set",
                                       "stations[0].lat_deg=49",
                                       "--set",
                                       "stations[0].lon_deg=8",
                                       "--set",
                                       "stations[0].height_m=100",
                                       NULL};
    const char *const links[] = {"links: [{type: \"null\"}]\n", beside};
    char hash[2][65];
    for (int i = 0; i < 2; i++) {
        config.links = links[i];
        struct head head = head_start(wire, room_config_write(wire, &config), args);
        head_end(&head, 0);
        stats_hash(wire, hash[i]);
    }
    assert_string_equal(hash[0], hash[1]);
}

static void the_stream_is_the_same(void **state)
{
    struct wire *wire = *state;
    const struct room_config beams = {
        .profile = "velodyne-vlp16", .prr_hz = 289351.851852, .lines_hz = 10, .more = START};
    size_t len;
    room_write(wire);
    expect_same(
        wire, planar(NULL),
        "links: [{type: \"null\"}, {type: tcp, port: 0, protocol: scip}, {type: tcp, port: 0, protocol: cola},\n"
        "  {type: pty, path: scip, protocol: scip}, {type: file, path: gnss, protocol: nmea}]\n");
    expect_same(wire, beams,
                "links: [{type: \"null\"}, {type: file, path: data, protocol: velodyne},\n"
                "  {type: file, path: position, protocol: velodyne-position}]\n");
    /* 289,351 firings a second, 192 a packet with two returns of each; 1206 bytes a packet */
    free(wire_read(wire_path(wire, "data"), &len));
    assert_int_equal(len, 289351 / 192 * 1206);
}

/* ---- a client that connects is answered at once, before the first scan, in it and between scans. The client's
 * commands to the head are in the journal, which repeats them. */

static void what_a_client_does_is_replayed(void **state)
{
    struct wire *wire = *state;
    static struct client c;
    char hash[2][65], journal[128];
    room_write(wire);
    struct room_config config = planar(SCIP_LINKS);
    snprintf(journal, sizeof journal, "%s", wire_path(wire, "journal"));
    const char *const first[] = {"--journal", journal, "--pace", "fast", NULL};
    struct head head = head_start(wire, room_config_write(wire, &config), first);
    c = (struct client){.fd = raw_connect(head_endpoint(&head, "tcp"))};
    expect(&c, "PP\n", "PP\n00P\nMODL:UTM-30LX"); /* the head boots for 0.2 s */
    laser_on(&c);
    expect(&c, "GD0000108000\n", "GD0000108000\n00P\n");
    expect(&c, "QT\n", "QT\n00P");
    close(c.fd);
    c = (struct client){.fd = raw_connect(head_endpoint(&head, "tcp"))};
    expect(&c, "PP\n", "PP\n00P\nMODL:UTM-30LX");
    close(c.fd);
    head_end(&head, SIGTERM);
    stats_hash(wire, hash[0]);
    assert_true(stats_uint(wire, "pulses") > 1081);
    char *text = wire_read(journal, NULL);
    assert_non_null(strstr(text, "SCAN:STAR"));
    free(text);
    const char *const again[] = {"--replay-journal", journal, "--pace", "fast", NULL};
    head = head_start(wire, room_config_write(wire, &config), again);
    head_end(&head, 0);
    stats_hash(wire, hash[1]);
    assert_string_equal(hash[0], hash[1]);
}

/* ---- one client at a time, one after the other */

static void many_come_one_after_the_other(void **state)
{
    struct wire *wire = *state;
    const int connections = thorough(10000, 2000);
    int refused = 0;
    static struct client c;
    room_write(wire);
    struct room_config config = planar(SCIP_LINKS);
    struct head head =
        head_start(wire, room_config_write(wire, &config), (const char *const[]){"--set", "head.start=on", NULL});
    const char *at = head_endpoint(&head, "tcp");
    wait_for_scan(at);
    for (int i = 0; i < connections; i++) {
        c = (struct client){.fd = raw_connect(at)};
        say(&c, i % 3 == 0 ? "PP\n" : i % 3 == 1 ? "VV\nPP\nMD0000" : "");
        if (i % 3 != 2) refused += answer(&c) == NULL;
        close(c.fd);
    }
    /* None is turned away because of the one before. The exception is where the system delivers the end of one and the
     * begin of the next out of order, on two processors: seen once in 50,000 on a busy machine. */
    assert_true(refused <= connections / 100);
    head_end(&head, SIGTERM);
    assert_true(stats_uint(wire, "pulses") > 0); /* the scan went on */
    assert_int_equal(stats_link_uint(wire, "lost_units"), 0);
}

/* ---- a client that doesn't read */

/* Streams scans and does not read them until the system holds no more. After that all that comes is whole, and lost
 * units are counted. */
static void a_client_that_does_not_read(void **state)
{
    struct wire *wire = *state;
    static struct client c;
    uint64_t scans = 0;
    room_write(wire);
    struct room_config config = planar("links: [{type: pty, path: scip, protocol: scip}, {type: tcp, port: 0}]\n");
    config.more = "time: {epoch: none}\nloop: {queue_ms: 100}\n";
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    c = (struct client){.fd = open(wire_path(wire, "scip"), O_RDWR | O_NOCTTY | O_CLOEXEC)};
    laser_on(&c);
    /* 6.7 kB a scan with levels, 40 scans/s; a pty holds 14 kB or so. */
    expect(&c, "ME0000108001000\n", "ME0000108001000\n00P");
    do
        client_next(sh, &frame);
    while (!is_event(&frame, SCANHEAD_EV_ERROR) || (int64_t)frame.event_value[0] != 102);
    expect(&c, "", "ME0000108001000\n99b");
    say(&c, "QT\n");
    for (const char *text; strncmp(text = answer(&c), "QT", 2) != 0;) {
        /* data lines of 64 characters and a sum, the last one shorter */
        assert_memory_equal(text, "ME0000108001000\n99b\n", 20);
        const char *line = strchr(text + 20, '\n') + 1;
        size_t data = 0;
        while (line != NULL && *line != '\0') {
            size_t n = strcspn(line, "\n");
            assert_true(n >= 2 && n <= 65);
            unsigned sum = 0;
            for (size_t i = 0; i + 1 < n; i++)
                sum += (unsigned char)line[i];
            assert_int_equal(line[n - 1], (char)((sum & 63) + 48));
            data += n - 1;
            line = line[n] == '\n' ? line + n + 1 : NULL;
        }
        assert_int_equal(data, 1081 * 6);
        scans++;
    }
    assert_true(scans > 0);
    close(c.fd);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_true(stats_link_uint(wire, "lost_units") > 0);
}

/* In the pace fast nothing is lost, as the head waits. There are 2 MB of scans. The head makes them faster than a pty
 * and this client carry them, and its queue has room for a fraction. */
static void a_fast_head_waits(void **state)
{
    struct wire *wire = *state;
    enum { SCANS = 600 };
    static struct client c;
    char t[4], before[4] = "";
    room_write(wire);
    struct room_config config = planar("links: [{type: pty, path: scip, protocol: scip}]\n");
    struct head head =
        head_start(wire, room_config_write(wire, &config), (const char *const[]){"--pace", "fast", NULL});
    c = (struct client){.fd = open(wire_path(wire, "scip"), O_RDWR | O_NOCTTY | O_CLOEXEC)};
    laser_on(&c);
    expect(&c, "MD0000108001000\n", "MD0000108001000\n00P");
    for (int scan = 0; scan < SCANS; scan++) {
        const char *text = answer(&c);
        assert_memory_equal(text, "MD0000108001000\n99b\n", 20);
        memcpy(t, text + 20, 4);
        /* By the device's own clock scans are 25 ms apart; it has 24 bits, 6 a character. */
        int ms = 0, was = 0;
        for (int i = 0; i < 4; i++) {
            ms = ms << 6 | (t[i] - 48);
            was = was << 6 | (before[i] - 48);
        }
        if (before[0] != '\0') assert_int_equal(ms - was, 25);
        memcpy(before, t, 4);
    }
    close(c.fd);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_link_uint(wire, "lost_units"), 0);
}

/* ---- garbage as fast as it can be sent, and a client that leaves in the middle of an answer */

static void garbage_and_sudden_ends(void **state)
{
    struct wire *wire = *state;
    enum { FLOOD = 1 << 21 };
    static struct client c;
    static char garbage[FLOOD];
    uint64_t random = 1;
    room_write(wire);
    struct room_config config = planar("links: [{type: tcp, port: 0, protocol: scip, max_sessions: 4}]\n");
    struct head head =
        head_start(wire, room_config_write(wire, &config), (const char *const[]){"--set", "head.start=on", NULL});
    const char *at = head_endpoint(&head, "tcp");
    wait_for_scan(at);
    for (int i = 0; i < 20; i++) { /* scans are on their way to it */
        c = (struct client){.fd = raw_connect(at)};
        expect(&c, "BM\nMD0000108001000\nMD00", "BM\n00P");
        assert_memory_equal(answer(&c), "MD0000108001000\n00P", 19);
        assert_memory_equal(answer(&c), "MD0000108001000\n99b", 19);
        const struct linger at_once = {.l_onoff = 1};
        assert_int_equal(setsockopt(c.fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once), 0);
        close(c.fd); /* a reset */
    }
    for (size_t i = 0; i < FLOOD; i++) {
        random = random * 6364136223846793005u + 1442695040888963407u;
        garbage[i] = (char)(random >> 56);
    }
    int fd = raw_connect(at);
    for (size_t sent = 0; sent < FLOOD;) {
        char in[65536];
        struct pollfd slot = {.fd = fd, .events = POLLIN | POLLOUT};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        if (slot.revents & POLLIN) assert_true(recv(fd, in, sizeof in, MSG_DONTWAIT) > 0);
        if (!(slot.revents & POLLOUT)) continue;
        ssize_t n = send(fd, garbage + sent, FLOOD - sent, MSG_DONTWAIT | MSG_NOSIGNAL);
        if (n > 0) sent += (size_t)n;
    }
    c = (struct client){.fd = raw_connect(at)}; /* beside it another client is served */
    expect(&c, "PP\n", "PP\n00P");
    close(c.fd);
    close(fd);
    head_end(&head, SIGTERM);
    assert_true(stats_link_uint(wire, "lost_input_bytes") + stats_link_uint(wire, "wrong_requests") > 0);
    assert_true(stats_uint(wire, "pulses") > 0); /* the scan went on */
}

/* ---- the head ends the session */

/* RB twice within a second starts the sensor anew. The client's connection is over, and the port stays. */
static void a_session_that_the_head_ends(void **state)
{
    struct wire *wire = *state;
    static struct client c;
    room_write(wire);
    struct room_config config = planar(SCIP_LINKS);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    const char *at = head_endpoint(&head, "tcp");
    c = (struct client){.fd = raw_connect(at)};
    expect(&c, "RB\n", "RB\n01Q");
    expect(&c, "RB\n", "RB\n00P");
    assert_null(answer(&c));
    close(c.fd);
    c = (struct client){.fd = raw_connect_again(at, "VV\n")};
    assert_memory_equal(answer(&c), "VV\n00P", 6);
    close(c.fd);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_stream_is_the_same, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(what_a_client_does_is_replayed, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(many_come_one_after_the_other, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_client_that_does_not_read, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_fast_head_waits, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(garbage_and_sudden_ends, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_session_that_the_head_ends, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
