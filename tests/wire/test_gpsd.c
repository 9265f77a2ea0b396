/* The GNSS receiver read by gpsd, the client that everybody has, and gpspipe. */
#include "tests/wire/gnss.h"

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
    int h = 0, m = 0, s = 0, ms = 0;
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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_gpsd, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
