/* The GNSS receiver on its links: gpsd, the client that everybody has; a reader that does not read; and the PPS of the
 * native stream beside the sentences. */
#include "tests/wire/room.h"

#include "tests/unit/nmea_reader.h"

/* Neither at the pole nor near zero; seven decimals of a degree and no rounding that helps. */
#define LAT_DEG  (-33.8567844)
#define LON_DEG  151.2152967
#define HEIGHT_M 87.6543
#define PLACE                                                                                        \
    "--set", "stations[0].lat_deg=-33.8567844", "--set", "stations[0].lon_deg=151.2152967", "--set", \
        "stations[0].height_m=87.6543"

#define NMEA_PTY "links: [{type: tcp, port: 0}, {type: pty, path: gnss, protocol: nmea}]\n"

static const struct room_config ROOM = {
    .prr_hz = 20000, .lines_hz = 50, .pan_deg_s = 60, .pan_stop_deg = 360, .frames = 0, .links = NMEA_PTY};

static const char *write_room(const struct wire *wire, const char *links)
{
    struct room_config config = ROOM;
    config.links = links;
    config.more = "loop: {late_ms: 10000}\n"
                  "time: {epoch: 2026-01-01T00:00:00Z}\n";
    room_write(wire);
    return room_config_write(wire, &config); /* its station has no place on the earth yet: PLACE */
}

/* ---- gpsd */

static int in_path(const char *program)
{
    char path[1024];
    const char *dirs[] = {"/usr/sbin", "/usr/local/sbin", "/usr/bin", "/usr/local/bin"};
    for (size_t i = 0; i < sizeof dirs / sizeof *dirs; i++) {
        snprintf(path, sizeof path, "%s/%s", dirs[i], program);
        if (access(path, X_OK) == 0) return 1;
    }
    return 0;
}

/* A port that nobody has just now. */
static int free_port(void)
{
    struct sockaddr_in at = {.sin_family = AF_INET};
    socklen_t len = sizeof at;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    getsockname(fd, (struct sockaddr *)&at, &len);
    close(fd);
    return ntohs(at.sin_port);
}

/* Starts a program of the system with its standard output on out_fd (-1: nowhere). */
static pid_t spawn(struct wire *wire, const char *const *args, int out_fd)
{
    char env_path[] = "PATH=/usr/sbin:/usr/bin:/sbin:/bin:/usr/local/sbin:/usr/local/bin", *env[] = {env_path, NULL};
    pid_t pid = wire_fork(wire);
    if (pid != 0) return pid;
    int null = open("/dev/null", O_RDWR);
    dup2(null, 0);
    dup2(out_fd >= 0 ? out_fd : null, 1);
    dup2(null, 2);
    signal(SIGPIPE, SIG_DFL);
    putenv(env[0]);
    execvp(args[0], (char *const *)(uintptr_t)args);
    _exit(127);
}

/* Until somebody listens there: the program that is to (pid) says nothing of it, so it is asked again and again. */
static void wait_listening(pid_t pid, int port)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    int pidfd = pidfd_open(pid, 0);
    for (;;) {
        int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        int rc = connect(fd, (struct sockaddr *)&at, sizeof at);
        close(fd);
        if (rc == 0) break;
        struct pollfd slot = {.fd = pidfd, .events = POLLIN};
        if (poll(&slot, 1, 20) != 0) fail_msg("gpsd ended before it listened");
        if (wire_now_ms() > end_ms) fail_msg("gpsd does not listen on port %d", port);
    }
    close(pidfd);
}

static void end_child(struct wire *wire, pid_t pid)
{
    kill(pid, SIGTERM);
    wire_wait(wire, pid);
}

/* The number behind "key": in a line of JSON; 0: there is none. */
static int json_number(const char *json, const char *key, double *value)
{
    char name[64], *end;
    snprintf(name, sizeof name, "\"%s\":", key);
    const char *at = strstr(json, name);
    if (at == NULL) return 0;
    *value = strtod(at + strlen(name), &end);
    return end != at + strlen(name);
}

struct gpsd {
    struct wire *wire;
    pid_t daemon, pipe;
    int fd;
    char buf[16384];
    size_t len;
};

static void gpsd_start(struct gpsd *g, struct wire *wire)
{
    char port[16], server[32], device[352];
    int number = free_port(), out[2];
    snprintf(port, sizeof port, "%d", number);
    snprintf(server, sizeof server, "127.0.0.1:%d", number);
    snprintf(device, sizeof device, "%s", wire_path(wire, "gnss"));
    const char *const daemon[] = {"gpsd", "-N", "-n", "-S", port, device, NULL};
    const char *const pipe_args[] = {"gpspipe", "-w", server, NULL};
    memset(g, 0, sizeof *g);
    g->wire = wire;
    g->daemon = spawn(wire, daemon, -1);
    wait_listening(g->daemon, number);
    assert_int_equal(pipe2(out, O_CLOEXEC), 0);
    g->pipe = spawn(wire, pipe_args, out[1]);
    close(out[1]);
    g->fd = out[0];
}

/* The next line of gpspipe; good until the next call. */
static const char *gpsd_line(struct gpsd *g)
{
    static char line[4096];
    char *end;
    while ((end = memchr(g->buf, '\n', g->len)) == NULL) {
        struct pollfd slot = {.fd = g->fd, .events = POLLIN};
        if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("gpspipe says nothing");
        assert_true(g->len < sizeof g->buf);
        ssize_t n = read(g->fd, g->buf + g->len, sizeof g->buf - g->len);
        if (n <= 0) fail_msg("gpspipe ended");
        g->len += (size_t)n;
    }
    size_t n = (size_t)(end - g->buf) + 1;
    snprintf(line, sizeof line, "%.*s", (int)n - 1, g->buf);
    memmove(g->buf, g->buf + n, g->len - n);
    g->len -= n;
    return line;
}

/* The next TPV with a position in three dimensions. */
static const char *gpsd_fix(struct gpsd *g)
{
    double mode;
    for (;;) {
        const char *line = gpsd_line(g);
        if (strstr(line, "\"class\":\"TPV\"") == NULL) continue;
        if (json_number(line, "mode", &mode) && mode == 3) return line;
    }
}

static void gpsd_stop(struct gpsd *g)
{
    close(g->fd);
    kill(g->pipe, SIGKILL);
    wire_wait(g->wire, g->pipe);
    end_child(g->wire, g->daemon);
}

/* "time":"2026-01-01T00:00:07.200Z" -> tenths of a second since midnight. */
static int tpv_tenths(const char *line)
{
    const char *at = strstr(line, "\"time\":\"2026-01-01T");
    int h, m, s, ms;
    if (at == NULL || sscanf(at + 19, "%d:%d:%d.%3dZ", &h, &m, &s, &ms) != 4) fail_msg("no time in %s", line);
    assert_int_equal(ms % 100, 0);
    return ((h * 60 + m) * 60 + s) * 10 + ms / 100;
}

static double number(const char *line, const char *key)
{
    double value = 0;
    if (!json_number(line, key, &value)) fail_msg("no %s in %s", key, line);
    return value;
}

/* Half a step of the sentence, 0.5e-7', and half of gpsd's nine decimals: 0.15 mm on the ground; of the heights, two of
 * four decimals in and one out. All of it together is 0.26 mm, and to be within 1 mm was promised. */
static const double ANGLE_TOLERANCE_DEG = 0.5e-7 / 60 + 0.5e-9 + 1e-12, HEIGHT_TOLERANCE_M = 3 * 0.5e-4 + 1e-9;

/* Status as gpsd_json(5) of 3.2x has it: 1 a fix (left out), 2 DGPS, 3 RTK fixed, 4 RTK float. */
static void check_gpsd(struct wire *wire, int quality, int status)
{
    char set[64];
    snprintf(set, sizeof set, "gnss.quality=%d", quality);
    const char *const more[] = {PLACE, "--set", "gnss.geoid_separation_m=22.4321", "--set", "gnss.rate_hz=5", "--set",
                                set,   NULL};
    struct head head = head_start(wire, write_room(wire, NMEA_PTY), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct gpsd gpsd;
    gpsd_start(&gpsd, wire);
    int before = -1;
    for (int n = 0; n < 3;) {
        const char *line = gpsd_fix(&gpsd);
        int tenths = tpv_tenths(line);
        double said = 1;
        json_number(line, "status", &said);
        if (said != status) fail_msg("status %g instead of %d: %s", said, status, line);
        assert_true(fabs(number(line, "lat") - LAT_DEG) <= ANGLE_TOLERANCE_DEG);
        assert_true(fabs(number(line, "lon") - LON_DEG) <= ANGLE_TOLERANCE_DEG);
        assert_true(fabs(number(line, "altHAE") - HEIGHT_M) <= HEIGHT_TOLERANCE_M);
        assert_true(fabs(number(line, "geoidSep") - 22.4321) <= 0.5e-3); /* gpsd gives three decimals */
        assert_true(number(line, "speed") == 0);
        /* gpsd may say the same moment twice, as sentences come; but misses none. */
        if (before >= 0 && tenths != before) assert_int_equal(tenths, before + 2);
        n += tenths != before;
        before = tenths;
        /* What it says is past: the head's own clock, asked now, is not before it. */
        int h, m;
        double s;
        assert_int_equal(sscanf(client_ask(sh, "TIME:UTC?"), "2026-01-01T%d:%d:%lfZ", &h, &m, &s), 3);
        assert_true(((h * 60 + m) * 60 + s) * 10 >= tenths);
    }
    gpsd_stop(&gpsd);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    wire_empty(wire);
}

static void test_gpsd(void **state)
{
    if (!in_path("gpsd") || !in_path("gpspipe")) {
        print_message("# no gpsd, gpspipe (packages gpsd, gpsd-clients)\n");
        skip();
    }
    check_gpsd(*state, 4, 3);
    check_gpsd(*state, 5, 4);
    check_gpsd(*state, 2, 2);
    check_gpsd(*state, 1, 1);
}

/* ---- sentences as they are */

static const char *const ORDER[5] = {"GNRMC", "GNGGA", "GNGSA", "GNGST", "GNZDA"};

/* What a reader has of the receiver's sentences: whole ones only, five to a moment, in their order. */
struct tally {
    char rest[256];
    size_t rest_len;
    int sentences, moments, first, last; /* of the first and last moment, twentieths of a second since midnight */
};

static void take_sentence(struct tally *t, const char *text, size_t len)
{
    struct nmea_line line;
    int h, m, s, hundredth;
    read_line(text, len, ORDER[t->sentences % 5], 0, &line);
    if (t->sentences++ % 5 != 1) return;
    assert_int_equal(sscanf(line.field[1], "%2d%2d%2d.%2d", &h, &m, &s, &hundredth), 4);
    int at = ((h * 60 + m) * 60 + s) * 20 + hundredth / 5;
    assert_true(t->moments == 0 || at > t->last);
    if (t->moments++ == 0) t->first = at;
    t->last = at;
}

static void take_bytes(struct tally *t, const char *bytes, size_t len)
{
    for (size_t i = 0; i < len; i++) {
        assert_true(t->rest_len < sizeof t->rest);
        t->rest[t->rest_len++] = bytes[i];
        if (bytes[i] != '\n') continue;
        take_sentence(t, t->rest, t->rest_len);
        t->rest_len = 0;
    }
}

/* Reads once; 0: the head is gone. */
static int tally_read(struct tally *t, int fd)
{
    char buf[4096];
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("no sentence");
    ssize_t n = read(fd, buf, sizeof buf);
    if (n <= 0) return 0;
    take_bytes(t, buf, (size_t)n);
    return 1;
}

/* 2026-01-01 is 16797 days after 1980-01-06 (46 years, 12 leap days, less 5); 18 leap seconds since (IERS Bulletin C).
 */
static const int64_t GPS0_S = INT64_C(16797) * 86400 + 18;

/* The recording of the native stream: each full second, and the GPS time of each pulse by them. */
static void check_recording(const char *path, int seconds)
{
    struct scanhead *sh = client_open(path);
    struct scanhead_frame frame;
    int64_t scan_t0_ns = -1;
    int pps = 0, points = 0;
    while (scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK) {
        if (is_event(&frame, SCANHEAD_EV_PPS)) {
            char text[32];
            snprintf(text, sizeof text, "2026-01-01T00:00:%02dZ", pps);
            assert_string_equal(frame.event_text, text);
            assert_true(frame.event_value[0] == (uint64_t)(1767225600 + pps)); /* date -u -d 2026-01-01 +%s */
            assert_true(frame.event_value[1] == (uint64_t)pps * 1000000000u);
            assert_true(frame.event_value[2] == (uint64_t)(GPS0_S + pps));
            pps++;
        }
        if (is_event(&frame, SCANHEAD_EV_SCAN_START)) {
            scan_t0_ns = (int64_t)frame.event_value[1];
            assert_true((int64_t)frame.event_value[2] == GPS0_S * 1000000000 + scan_t0_ns);
        }
        if (frame.type != SCANHEAD_POINTS) continue;
        struct scanhead_point p;
        double gps_s, wanted_s;
        points++;
        assert_int_equal(scanhead_points(sh, &frame, 0, &p, 1), 1);
        assert_int_equal(scanhead_gps_time(sh, p.t_ns, &gps_s), SCANHEAD_OK);
        wanted_s = (double)(GPS0_S - 1000000000) + 1e-9 * (double)(scan_t0_ns + p.t_ns);
        assert_true(fabs(gps_s - wanted_s) <= 0x1p-23); /* two roundings of a number below 2^30, in steps of 2^-23 s */
    }
    assert_true(scan_t0_ns > 0 && points > 100);
    assert_int_equal(pps, seconds);
    scanhead_close(sh);
}

/* Off the clock, into files: all of it, twice the same, and the stream's hash is that of a head without. */
static void test_files(void **state)
{
    struct wire *wire = *state;
    static const char *const more[] = {"--start", "--pace", "fast",  "--duration",      "3",     "--frames",
                                       "0",       PLACE,    "--set", "gnss.rate_hz=20", "--set", "gnss.accuracy_m=0.02",
                                       NULL};
    static const char *const plain[] = {"--start", "--pace", "fast",  "--duration",      "3", "--frames",
                                        "0",       PLACE,    "--set", "time.epoch=none", NULL};
    char *text[2], hash[3][65];
    size_t len[2];
    for (int i = 0; i < 2; i++) {
        struct head head = head_start(wire,
                                      write_room(wire, "links: [{type: file, path: all.nmea, protocol: nmea},"
                                                       " {type: file, path: all.shs}]\n"),
                                      more);
        head_end(&head, 0);
        stats_hash(wire, hash[i]);
        text[i] = wire_read(wire_path(wire, "all.nmea"), &len[i]);
    }
    assert_true(len[0] == len[1]);
    assert_memory_equal(text[0], text[1], len[0]);
    struct tally t = {.rest_len = 0};
    take_bytes(&t, text[0], len[0]);
    assert_int_equal(t.rest_len, 0);
    assert_int_equal(t.sentences, 5 * t.moments);
    assert_int_equal(t.first, 0);
    assert_int_equal(t.last - t.first + 1, t.moments);
    check_recording(wire_path(wire, "all.shs"), t.last / 20 + 1);
    struct head head = head_start(wire, write_room(wire, "links: [{type: \"null\"}]\n"), plain);
    head_end(&head, 0);
    stats_hash(wire, hash[2]);
    assert_string_equal(hash[0], hash[1]);
    assert_string_equal(hash[0], hash[2]);
    free(text[0]);
    free(text[1]);
}

/* What a client sends a receiver is no command; the receiver goes on. */
static void test_receiver_takes_no_commands(void **state)
{
    struct wire *wire = *state;
    static const char *const more[] = {PLACE, "--set", "gnss.rate_hz=20", NULL};
    static const char noise[] = "SCAN:START\r\nHEAD:PRR 1e9\n$PUBX,00*33\r\n\xb5\x62\x0a\x04 nonsense";
    struct head head = head_start(wire, write_room(wire, NMEA_PTY), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct tally t = {.rest_len = 0};
    assert_non_null(strstr(head.ready, "gnss\",\"protocol\":\"nmea\"}"));
    client_wait_state(sh, "idle");
    int fd = open(wire_path(wire, "gnss"), O_RDWR | O_NOCTTY | O_CLOEXEC);
    raw_write(fd, noise, sizeof noise - 1);
    while (t.moments < 3)
        tally_read(&t, fd);
    assert_string_equal(client_ask(sh, "HEAD:STAT?"), "idle");
    assert_string_equal(client_ask(sh, "SYST:CONT?"), "0");
    close(fd);
    /* Another reader comes, while the head scans. */
    client_tell(sh, "SCAN:START");
    memset(&t, 0, sizeof t);
    fd = open(wire_path(wire, "gnss"), O_RDWR | O_NOCTTY | O_CLOEXEC);
    while (t.moments < 3)
        tally_read(&t, fd);
    assert_int_equal(t.last - t.first, 2);
    close(fd);
    client_tell(sh, "SCAN:STOP");
    assert_string_equal(client_ask(sh, "SYST:ERR?"), "0,\"No error\"");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* A port that is open but not read: what the system can't hold is lost, whole moments, counted and said; what comes
 * after the reader is back is whole again. */
static void test_slow_reader(void **state)
{
    struct wire *wire = *state;
    static const char *const more[] = {PLACE, "--set", "gnss.rate_hz=20", "--set", "loop.queue_ms=100", NULL};
    struct head head = head_start(wire, write_room(wire, NMEA_PTY), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    struct tally t = {.rest_len = 0};
    int fd = open(wire_path(wire, "gnss"), O_RDWR | O_NOCTTY | O_CLOEXEC);
    /* 6.7 kB/s: what a pty holds, 14 kB or so, and the queue are full within three of the six seconds. */
    for (int pps = 0; pps < 6; pps++)
        client_until(sh, SCANHEAD_EV_PPS, &frame);
    int back = (int)(frame.event_value[0] - 1767225600) * 20;
    while (t.last < back + 20)
        assert_true(tally_read(&t, fd));
    int missing = t.last - t.first + 1 - t.moments;
    assert_true(missing > 0);
    assert_int_equal(atoi(client_ask(sh, "SYST:ERR?")), 102);
    assert_int_equal(atoi(client_ask(sh, "SYST:ERR?")), 0); /* said once */
    scanhead_close(sh);
    assert_int_equal(kill(head.pid, SIGTERM), 0);
    while (tally_read(&t, fd))
        continue;
    close(fd);
    assert_int_equal(t.last - t.first + 1 - t.moments, missing); /* none any more since it is back */
    assert_int_equal(t.rest_len, 0);
    head_end(&head, 0);
    assert_int_equal(stats_uint(wire, "reader_lost_frames"), 5 * missing);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_gpsd, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_files, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_receiver_takes_no_commands, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_slow_reader, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
