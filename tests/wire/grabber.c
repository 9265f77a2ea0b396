/* SPDX-License-Identifier: MIT */
#include "tests/wire/grabber.h"

#include <pty.h>
#include <sched.h>

#define PROGRAM "/usr/bin/rawlog-grabber"

void grabber_or_skip(void)
{
    if (access(PROGRAM, X_OK) == 0) return;
    print_message("%s is not there: package mrpt-apps\n", PROGRAM);
    skip();
}

void grabber_hurry(pid_t pid)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/task", (int)pid);
    DIR *dir = opendir(path);
    assert_non_null(dir);
    for (struct dirent *entry; (entry = readdir(dir)) != NULL;) {
        const pid_t thread = (pid_t)atoi(entry->d_name);
        const struct sched_param param = {.sched_priority = 1};
        if (thread != 0 && sched_getscheduler(thread) == SCHED_OTHER) sched_setscheduler(thread, SCHED_RR, &param);
    }
    closedir(dir);
}

void grabber_start(struct wire *wire, const char *name, const char *sensor, struct grabber *grabber)
{
    char text[2048], file[64], path[352];
    *grabber = (struct grabber){.wire = wire};
    snprintf(grabber->name, sizeof grabber->name, "%s", name);
    /* Sensors are asked 10,000 times a second, as one call reads one packet. New observations are saved every 10 ms. */
    snprintf(text, sizeof text,
             "[global]\nrawlog_prefix = %s/%s\ntime_between_launches = 10\nuse_sensoryframes = false\n"
             "GRABBER_PERIOD_MS = 10\n\n[%s]\nsensorLabel = %s\nprocess_rate = 10000\nmax_queue_len = 10000\n"
             "pose_x = 0\npose_y = 0\npose_z = 0\npose_yaw = 0\npose_pitch = 0\npose_roll = 0\n%s",
             wire->dir, name, name, name, sensor);
    snprintf(file, sizeof file, "%s.ini", name);
    snprintf(path, sizeof path, "%s", wire_write_text(wire, file, text));
    /* The grabber writes to a terminal, and therefore line by line. */
    int in[2], out[2];
    assert_int_equal(pipe2(in, O_CLOEXEC), 0);
    assert_int_equal(openpty(&out[0], &out[1], NULL, NULL, NULL), 0);
    fcntl(out[0], F_SETFD, FD_CLOEXEC);
    fcntl(out[1], F_SETFD, FD_CLOEXEC);
    grabber->pid = wire_fork(wire);
    if (grabber->pid == 0) {
        grabber_hurry(getpid());
        dup2(in[0], 0);
        dup2(out[1], 1);
        dup2(out[1], 2);
        signal(SIGPIPE, SIG_DFL);
        execl(PROGRAM, PROGRAM, path, NULL);
        _exit(127);
    }
    close(in[0]);
    close(out[1]);
    grabber->in_fd = in[1];
    grabber->out_fd = out[0];
}

/* Reads its output. Returns 0 when no more will come. */
static int listen_to(struct grabber *grabber)
{
    struct pollfd slot = {.fd = grabber->out_fd, .events = POLLIN};
    if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("rawlog-grabber says nothing more:\n%s", grabber->said);
    if (grabber->n_said == sizeof grabber->said - 1) fail_msg("rawlog-grabber says too much:\n%s", grabber->said);
    ssize_t n = read(grabber->out_fd, grabber->said + grabber->n_said, sizeof grabber->said - 1 - grabber->n_said);
    if (n > 0) grabber->n_said += (size_t)n;
    return n > 0;
}

static int n_saved(const struct grabber *grabber)
{
    int n = 0, one;
    for (const char *at = grabber->said; (at = strstr(at, "Saved ")) != NULL; at++)
        if (sscanf(at, "Saved %d objects", &one) == 1) n += one;
    return n;
}

int grabber_wait(struct grabber *grabber, int wanted)
{
    while (n_saved(grabber) < wanted) {
        if (!listen_to(grabber)) fail_msg("rawlog-grabber ended:\n%s", grabber->said);
        if (strstr(grabber->said, "|ERROR|") != NULL) return 0;
    }
    return 1;
}

enum { TRIES = 15 };

void grabber_start_and_wait(struct wire *wire, const char *name, const char *sensor, int wanted,
                            struct grabber *grabber)
{
    for (int i = 1; i <= TRIES; i++) {
        char numbered[16];
        snprintf(numbered, sizeof numbered, "%s%d", name, i);
        grabber_start(wire, numbered, sensor, grabber);
        if (grabber_wait(grabber, wanted)) return;
        printf("rawlog-grabber complains:\n%s\n", grabber->said); /* print_message cuts long texts and their newline */
        fflush(stdout);
        grabber_end(grabber);
    }
    fail_msg("rawlog-grabber complains %d times", TRIES);
}

void grabber_end(struct grabber *grabber)
{
    raw_send(grabber->in_fd, "\n", 1);
    while (listen_to(grabber)) {
    }
    close(grabber->in_fd);
    close(grabber->out_fd);
    int status = wire_wait(grabber->wire, grabber->pid);
    if (status != 0) fail_msg("rawlog-grabber: status %d\n%s", status, grabber->said);
}

uint32_t grabber_dropped_at(int port)
{
    char line[256];
    unsigned local, drops, sum = 0;
    FILE *f = fopen("/proc/net/udp", "r");
    assert_non_null(f);
    while (fgets(line, sizeof line, f) != NULL)
        if (sscanf(line, "%*d: %*x:%x %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %u", &local, &drops) == 2 &&
            (int)local == port)
            sum += drops;
    fclose(f);
    return sum;
}

/* ---- rawlogs */

static const uint8_t *skip_text(const uint8_t *at)
{
    uint32_t len;
    memcpy(&len, at, 4);
    return at + 4 + len;
}

/* A nested object is 0x80 + the length of its class's name, the name, a version, 12 doubles, and an end mark. */
static const uint8_t *skip_pose(const uint8_t *at)
{
    return at + 1 + (at[0] & 0x7f) + 1 + 12 * 8 + 1;
}

static int64_t time_at(const uint8_t *at)
{
    int64_t t;
    memcpy(&t, at, 8);
    return t;
}

static void read_scan(const uint8_t *at, struct rawlog_item *item)
{
    float aperture;
    memcpy(&aperture, at, 4);
    item->kind = RAWLOG_SCAN;
    item->aperture_rad = (double)aperture;
    item->right_to_left = at[4];
    at = skip_pose(at + 9);
    memcpy(&item->n, at, 4);
    item->range = at + 4;
    item->valid = item->range + 4 * (size_t)item->n;
    item->t_100ns = time_at(item->valid + item->n + 4);
}

static void read_turn(const uint8_t *at, struct rawlog_item *item)
{
    item->kind = RAWLOG_TURN;
    item->t_100ns = time_at(at);
    at = skip_pose(skip_text(at + 8) + 16);
    memcpy(&item->n, at, 4);
    item->packets = at + 4;
}

static void read_gps(const uint8_t *at, struct rawlog_item *item)
{
    item->kind = RAWLOG_GPS;
    item->t_100ns = time_at(at);
}

void rawlog_read(const struct grabber *grabber, struct rawlog *log)
{
    static const struct {
        const char *name;
        uint8_t first, last; /* versions that begin with the same fields: MRPT 2.5, 2.14 */
        void (*read)(const uint8_t *at, struct rawlog_item *item);
    } classes[] = {{"mrpt::obs::CObservation2DRangeScan", 7, 7, read_scan},
                   {"mrpt::obs::CObservationVelodyneScan", 2, 2, read_turn},
                   {"mrpt::obs::CObservationGPS", 11, 12, read_gps}};
    char path[352] = "", prefix[32];
    snprintf(prefix, sizeof prefix, "%s_", grabber->name);
    DIR *dir = opendir(grabber->wire->dir);
    assert_non_null(dir);
    for (struct dirent *entry; (entry = readdir(dir)) != NULL;)
        if (strncmp(entry->d_name, prefix, strlen(prefix)) == 0 && strstr(entry->d_name, ".rawlog") != NULL)
            snprintf(path, sizeof path, "%s", wire_path(grabber->wire, entry->d_name));
    closedir(dir);
    if (path[0] == '\0') fail_msg("rawlog-grabber wrote nothing:\n%s", grabber->said);
    const char *const args[] = {"-dc", path, NULL};
    assert_int_equal(
        wire_wait(grabber->wire, wire_spawn_program(grabber->wire, "/bin/gzip", args, "rawlog", "gzip.err", -1)), 0);
    *log = (struct rawlog){0};
    log->bytes = (uint8_t *)wire_read(wire_path(grabber->wire, "rawlog"), &log->len);
    const uint8_t *at = log->bytes, *end = at + log->len;
    while (at < end && (at = memmem(at, (size_t)(end - at), "mrpt::obs::", 11)) != NULL) {
        for (size_t i = 0; i < sizeof classes / sizeof classes[0]; i++) {
            const size_t len = strlen(classes[i].name);
            if ((size_t)(end - at) <= len || memcmp(at, classes[i].name, len) != 0) continue;
            assert_in_range(at[len], classes[i].first, classes[i].last);
            log->item = realloc(log->item, (log->n_items + 1) * sizeof *log->item);
            assert_non_null(log->item);
            log->item[log->n_items] = (struct rawlog_item){0};
            classes[i].read(at + len + 1, &log->item[log->n_items++]);
        }
        at += 11;
    }
}

void rawlog_free(struct rawlog *log)
{
    free(log->item);
    free(log->bytes);
}

double rawlog_range_m(const struct rawlog_item *scan, uint32_t i)
{
    float range_m;
    memcpy(&range_m, scan->range + 4 * (size_t)i, 4);
    return (double)range_m;
}
