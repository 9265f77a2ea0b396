/* SPDX-License-Identifier: MIT */
/* Recorders are killed, and disks are full, at random moments. The repaired file has all that came to the disk, and
 * says that its end is missing. The recorder reads a stream through a pipe, so a moment is a byte of the stream, and a
 * short wait. FILE.part itself shows what was left. REPAIR_N is how many moments each format has. From 20 on other
 * people's programs read some of them, too (make repair). */
#include <limits.h>
#include <sched.h>
#include <sys/inotify.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include "tests/wire/repair_cases.h"

enum { N_QUICK = 1, N_WITH_READERS = 20, SMALL = 1 << 16, PAGE = 4096 };

/* Two stations, so that headers change within a recording. */
static const char CONFIG[] =
    "head: {profile: full-sweep, prr_hz: 20000, lines_hz: 47, pan_deg_s: 120, pan_stop_deg: 350, frames: 1}\n"
    "scene: {meshes: [{file: yard.obj, up: z, scale: 1}]}\n"
    "stations:\n"
    "  - {position_m: [1.5, -2.25, 0.2], heading_deg: 30, lat_deg: 52.5167, lon_deg: 13.4, height_m: 110.2}\n"
    "  - {position_m: [-7.1, 3.3, 1.1], heading_deg: 215, lat_deg: 52.51674987, lon_deg: 13.39987326, height_m: "
    "111.1}\n"
    "output: {crs: utm, layout: geo}\n"
    "links: [{type: \"null\"}]\n";
static const char YARD[] = "v -20 -15 -1.5\nv 25 -15 -1.5\nv 25 18 -1.5\nv -20 18 -1.5\n"
                           "v -20 -15 4\nv 25 -15 4\nv 25 18 4\nv -20 18 4\n"
                           "o floor\nf 1 2 3 4\no south\nf 1 2 6 5\no east\nf 2 3 7 6\no north\nf 3 4 8 7\n";

static struct wire *wire;
static struct bytes stream;
static uint64_t n_moments = N_QUICK;
static char disk[80]; /* a small one, where it can be had; else empty */
static uint64_t random_state = 20261123;

/* splitmix64; below n */
static uint64_t random_below(uint64_t n)
{
    uint64_t z = random_state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return n > 0 ? (z ^ z >> 31) % n : 0;
}

static struct bytes slurp(const char *path)
{
    struct bytes b;
    b.data = (uint8_t *)wire_read(path, &b.len);
    return b;
}

/* ---- one recording */

/* The bytes of the stream that the recorder gets. Then the recorder is killed, unless it ends by itself. */
struct moment {
    size_t fed;
    int kills, ends; /* ends: nothing more comes */
    unsigned wait_us;
    rlim_t file_most; /* bytes of a file; 0: any number */
};

static char said[4096]; /* by the last recorder */

static pid_t spawn(const struct repair_row *row, const char *path, int from, int err, rlim_t file_most)
{
    const pid_t pid = wire_fork(wire);
    if (pid != 0) return pid;
    const char *args[24] = {wire_program(), "record", "fd:0", "--listen", "--quiet", "-o", path};
    for (int i = 0, n = 7; row->option[i] != NULL; i++)
        args[n++] = row->option[i];
    if (dup2(from, 0) < 0 || dup2(err, 1) < 0 || dup2(err, 2) < 0) _exit(126);
    const struct rlimit most = {file_most, file_most};
    signal(SIGXFSZ, SIG_IGN);
    if (file_most != 0 && setrlimit(RLIMIT_FSIZE, &most) != 0) _exit(126);
    execv(args[0], (char **)(uintptr_t)args);
    _exit(127);
}

/* Returns the exit status, or 256 + the signal. */
static int record(const struct repair_row *row, const char *path, const struct moment *m)
{
    int ends[2], err[2]; /* a file of messages would have the limit, too */
    assert_int_equal(pipe2(ends, O_CLOEXEC), 0);
    assert_int_equal(pipe2(err, O_CLOEXEC), 0);
    const pid_t pid = spawn(row, path, ends[0], err[1], m->file_most);
    close(ends[0]);
    close(err[1]);
    for (size_t at = 0; at < m->fed;) {
        const ssize_t n = write(ends[1], stream.data + at, m->fed - at);
        if (n < 0) break; /* it has ended */
        at += (size_t)n;
    }
    if (m->ends) close(ends[1]);
    if (m->wait_us > 0) usleep(m->wait_us); /* nothing waits for this moment */
    if (m->kills) kill(pid, SIGKILL);
    const int status = wire_wait(wire, pid);
    if (!m->ends) close(ends[1]);
    const ssize_t n = read(err[0], said, sizeof said - 1); /* a few lines: they are all in the pipe */
    said[n > 0 ? n : 0] = '\0';
    close(err[0]);
    return status;
}

/* Repairs, and writes its printed lines to `out`. */
static int repair(const char *path, char out[2048])
{
    const char *const args[] = {"record", "--repair", path, NULL};
    const int status = wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
    char *text = wire_read(wire_path(wire, "err"), NULL);
    snprintf(out, 2048, "%s", text);
    free(text);
    return status;
}

/* A repair that is itself killed. Another one continues with the files that it left. */
static void repair_in_part(const char *path)
{
    const char *const args[] = {"record", "--repair", path, NULL};
    const pid_t pid = wire_spawn(wire, args, "out", "err", -1);
    usleep((unsigned)random_below(15000)); /* it takes some 10 ms */
    kill(pid, SIGKILL);
    wire_wait(wire, pid);
}

/* ---- the left part */

struct tally {
    uint64_t whole, repaired, none;
    uint64_t kept, last_kept;
};

static void check_again(const char *path, const struct bytes *repaired)
{
    char out[2048];
    assert_int_equal(repair(path, out), 0);
    if (strstr(out, ": whole: ") == NULL) fail_msg("%s", out);
    struct bytes again = slurp(path);
    assert_int_equal(again.len, repaired->len);
    assert_memory_equal(again.data, repaired->data, again.len);
    free(again.data);
}

static void path_beside(const struct repair_row *row, const char *path, char beside[160])
{
    const char *ending = repair_row_beside(row);
    snprintf(beside, 160, "%s%s", path, ending != NULL ? ending : "");
}

static void read_beside(const struct repair_row *row, const char *path)
{
    char beside[160];
    path_beside(row, path, beside);
    free(repair_beside.data);
    repair_beside = (struct bytes){NULL, 0};
    if (access(beside, F_OK) == 0) repair_beside = slurp(beside);
}

static void check_left(const struct repair_row *row, const char *path, const struct bytes *whole, struct tally *tally)
{
    char part[160], out[2048];
    snprintf(part, sizeof part, "%s.part", path);
    if (access(part, F_OK) != 0) { /* before it was made, or after all was done */
        tally->whole += access(path, F_OK) == 0;
        if (access(path, F_OK) != 0) return;
        struct bytes got = slurp(path);
        assert_int_equal(got.len, whole->len);
        assert_memory_equal(got.data, whole->data, got.len);
        free(got.data);
        return;
    }
    assert_int_equal(access(path, F_OK), -1);
    struct bytes left = slurp(part);
    if (repair_row_beside(row) != NULL) read_beside(row, path);
    if (n_moments >= N_WITH_READERS && random_below(4) == 0) repair_in_part(part);
    const int is_done = access(part, F_OK) != 0;
    const int status = repair(random_below(2) || is_done ? path : part, out);
    if (row->is_none(&left)) {
        tally->none++;
        assert_int_equal(status, 2);
        assert_non_null(strstr(out, part));
        free(left.data);
        return;
    }
    if (status != 0) fail_msg("%s: %zu bytes were left, status %d: %s", path, left.len, status, out);
    assert_int_equal(access(part, F_OK), -1);
    if (repair_row_beside(row) != NULL) {
        char beside[160];
        path_beside(row, path, beside);
        assert_int_equal(access(beside, F_OK), -1);
    }
    struct bytes repaired = slurp(path);
    const char *kept = strstr(out, is_done ? "whole: " : ": kept ");
    if (kept == NULL) fail_msg("%s", out);
    tally->last_kept = left.len == whole->len && memcmp(left.data, whole->data, left.len) == 0
                           ? strtoull(kept + 7, NULL, 10) /* killed before it was renamed */
                           : row->check(whole, &left, &repaired);
    assert_int_equal(strtoull(kept + 7, NULL, 10), tally->last_kept);
    tally->kept += tally->last_kept;
    tally->repaired++;
    check_again(path, &repaired);
    free(left.data);
    free(repaired.data);
}

static void remove_both(const char *path)
{
    char part[160];
    snprintf(part, sizeof part, "%s.part", path);
    unlink(path);
    unlink(part);
}

static void remove_all(const struct repair_row *row, const char *path)
{
    char beside[160];
    path_beside(row, path, beside);
    if (repair_row_beside(row) != NULL) unlink(beside);
    remove_both(path);
}

/* The reader prints as many lines as the file has units. */
static void check_reader(const struct repair_row *row, const char *path, uint64_t n)
{
    const char *args[10] = {"env", "QT_QPA_PLATFORM=offscreen"};
    char file[160];
    size_t got = 0;
    int k = 2;
    snprintf(file, sizeof file, "F=%s", path);
    args[k++] = file;
    for (int i = 0; i < 6 && row->reader[i] != NULL; i++)
        args[k++] = strcmp(row->reader[i], "$F") == 0 ? path : row->reader[i];
    const pid_t pid = wire_fork(wire);
    char out[128];
    snprintf(out, sizeof out, "%s", wire_path(wire, "read"));
    if (pid == 0) {
        const int o = open(out, O_WRONLY | O_CREAT | O_TRUNC, 0600), none = open("/dev/null", O_WRONLY);
        if (chdir(wire->dir) != 0 || dup2(o, 1) < 0 || dup2(none, 2) < 0) _exit(126);
        execvp(args[0], (char **)(uintptr_t)args);
        _exit(127);
    }
    const int status = wire_wait(wire, pid);
    if (status == 127) {
        print_message("# %s%s: its reader is not installed\n", row->name, row->ending);
        return;
    }
    struct bytes read = slurp(out);
    for (size_t i = 0; i < read.len; i++)
        got += read.data[i] == '\n';
    free(read.data);
    if (status != 0 || got != n)
        fail_msg("%s: the reader has status %d and %zu units, of %llu", path, status, got, (unsigned long long)n);
}

/* ---- tests */

static struct bytes record_whole(const struct repair_row *row, const char *path)
{
    const struct moment all = {.fed = stream.len, .ends = 1};
    const int status = record(row, path, &all);
    if (status != 0) fail_msg("%s", said);
    struct bytes whole = slurp(path);
    unlink(path);
    return whole;
}

static void tell(const struct repair_row *row, const char *what, const struct tally *t)
{
    print_message("# %s%s %s: %llu repaired, %llu units kept, %llu whole, %llu with nothing in it\n", row->name,
                  row->ending, what, (unsigned long long)t->repaired, (unsigned long long)t->kept,
                  (unsigned long long)t->whole, (unsigned long long)t->none);
}

static void kill_one_format(const struct repair_row *row, const struct bytes *whole, const char *path)
{
    struct tally tally = {0};
    for (uint64_t i = 0; i < n_moments; i++) {
        const size_t piece = stream.len / n_moments;
        struct moment m = {.kills = 1, .wait_us = (unsigned)random_below(3000)};
        m.fed =
            (i + 1) * piece - random_below(piece / 4 + 1); /* the last one is near the end, also where they are few */
        if (i % 8 == 7)
            m = (struct moment){.fed = stream.len, .kills = 1, .ends = 1, .wait_us = (unsigned)random_below(20000)};
        const uint64_t before = tally.repaired;
        record(row, path, &m);
        check_left(row, path, whole, &tally);
        if (tally.repaired > before && n_moments >= N_WITH_READERS && tally.repaired % N_WITH_READERS == 1 &&
            row->reader[0] != NULL)
            check_reader(row, path, tally.last_kept);
        remove_all(row, path);
    }
    tell(row, "killed", &tally);
    assert_true(tally.repaired > 0 || whole->len < SMALL); /* a small file may not be on the disk within a second */
}

/* Makes a disk with room for so many bytes, or sets a limit of the file's size. */
static void fill(const struct repair_row *row, const struct bytes *whole, struct tally *tally)
{
    char path[160], size[32];
    struct moment m = {.fed = stream.len, .ends = 1};
    const size_t room = 1 + random_below(whole->len - 1);
    const int is_real = disk[0] != '\0' && whole->len >= SMALL;
    snprintf(size, sizeof size, "size=%zu", (room + PAGE - 1) / PAGE * PAGE);
    if (is_real && (room + PAGE - 1) / PAGE * PAGE >= whole->len) return;
    if (is_real) assert_int_equal(mount("none", disk, "tmpfs", 0, size), 0);
    snprintf(path, sizeof path, "%s/%s%s", is_real ? disk : wire->dir, row->name, row->ending);
    if (!is_real) m.file_most = room;
    assert_int_equal(record(row, path, &m), 1);
    const char *says = is_real ? "cannot write: No space left on device\n" : "cannot write: File too large\n";
    const char *at = strstr(said, says);
    char part[176];
    snprintf(part, sizeof part, "%s.part", path);
    const int is_left = access(part, F_OK) == 0; /* on the smallest disks nothing is */
    if (at == NULL || strstr(at + 1, says) != NULL || (strstr(said, "scanhead record --repair ") != NULL) != is_left)
        fail_msg("%s: %s", path, said);
    if (is_real && repair_row_beside(row) != NULL)
        assert_int_equal(mount("none", disk, NULL, MS_REMOUNT, "size=16m"), 0);
    check_left(row, path, whole, tally);
    remove_all(row, path);
    if (is_real) assert_int_equal(umount(disk), 0);
}

static void fill_one_format(const struct repair_row *row, const struct bytes *whole)
{
    struct tally tally = {0};
    for (uint64_t k = 0; k < n_moments; k++)
        fill(row, whole, &tally);
    tell(row, "on a full disk", &tally);
    assert_int_equal(tally.whole, 0);
}

/* state: a row */
static void test_format(void **state)
{
    const struct repair_row *row = *state;
    char name[64], path[128];
    snprintf(name, sizeof name, "%s%s", row->name, row->ending);
    snprintf(path, sizeof path, "%s", wire_path(wire, name));
    struct bytes whole = record_whole(row, path);
    kill_one_format(row, &whole, path);
    fill_one_format(row, &whole);
    free(whole.data);
}

/* ---- a slow head */

static int is_written(const char *const *path, int n)
{
    struct stat st;
    for (int i = 0; i < n; i++) {
        char part[160];
        snprintf(part, sizeof part, "%s.part", path[i]);
        if (stat(part, &st) != 0 || st.st_size == 0) return 0;
    }
    return 1;
}

/* Far fewer bytes come than a buffer holds, and then none. They come to the disk all the same. */
static void test_slow_head(void **state)
{
    enum { N = 4 };
    static const char *const name[N] = {"slow.shs", "slow.pcapng", "slow.ply", "slow.las"};
    static char path[N][128], out[2048];
    const char *paths[N];
    const struct repair_row row = {.ending = "", .option = {"-o", path[1], "-o", path[2], "-o", path[3]}};
    (void)state;
    for (int i = 0; i < N; i++) {
        snprintf(path[i], sizeof path[i], "%s", wire_path(wire, name[i]));
        paths[i] = path[i];
    }
    int ends[2], none = open("/dev/null", O_WRONLY | O_CLOEXEC), notify = inotify_init1(IN_CLOEXEC);
    assert_true(inotify_add_watch(notify, wire->dir, IN_MODIFY) >= 0);
    assert_int_equal(pipe2(ends, O_CLOEXEC), 0);
    const pid_t pid = spawn(&row, path[0], ends[0], none, 0);
    close(none);
    close(ends[0]);
    assert_int_equal(write(ends[1], stream.data, SMALL), SMALL);
    const int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    while (!is_written(paths, N)) {
        struct pollfd in = {.fd = notify, .events = POLLIN};
        char event[4096];
        assert_true(poll(&in, 1, (int)(end_ms - wire_now_ms())) == 1 && read(notify, event, sizeof event) > 0);
    }
    close(notify);
    kill(pid, SIGKILL);
    wire_wait(wire, pid);
    close(ends[1]);
    for (int i = 0; i < N; i++) {
        assert_int_equal(repair(path[i], out), 0);
        if (strstr(out, ": kept ") == NULL || strstr(out, ": kept 0 ") != NULL) fail_msg("%s", out);
        remove_all(&row, path[i]);
    }
}

/* ---- the stream, and the disk */

static int set_up(void **state)
{
    const char *n = getenv("REPAIR_N");
    if (wire_setup(state) != 0) return -1;
    wire = *state;
    *state = NULL; /* each test sets it to its row */
    if (n != NULL) n_moments = strtoull(n, NULL, 10);
    signal(SIGPIPE, SIG_IGN);
    char readers[PATH_MAX];
    if (realpath(getenv("READERS") != NULL ? getenv("READERS") : "build/readers", readers) != NULL)
        setenv("READERS", readers, 1);
    char config[128], path[128];
    wire_write_text(wire, "yard.obj", YARD);
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "config.yaml", CONFIG));
    snprintf(path, sizeof path, "%s", wire_path(wire, "in.shs"));
    const char *const args[] = {"record", config, "--station", "all", "--quiet", "-o", path, NULL};
    if (wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)) != 0) wire_show(wire, "err");
    stream = slurp(path);
    snprintf(disk, sizeof disk, "%s/disk", wire->dir);
    if (mkdir(disk, 0700) != 0 || unshare(CLONE_NEWNS) != 0 ||
        mount("none", "/", NULL, MS_REC | MS_PRIVATE, NULL) != 0) {
        print_message("# no disk of its own can be made: limits on the size of files stand for it\n");
        rmdir(disk);
        disk[0] = '\0';
    }
    return 0;
}

static int tear_down(void **state)
{
    void *folder = wire;
    (void)state;
    if (disk[0] != '\0') umount2(disk, MNT_DETACH);
    free(stream.data);
    free(repair_beside.data);
    return wire_teardown(&folder);
}

int main(void)
{
    struct CMUnitTest tests[64] = {{0}};
    char name[64][32];
    for (size_t i = 0; i < n_repair_cases && i < 63; i++) {
        snprintf(name[i], sizeof name[i], "%s%s", repair_cases[i].name, repair_cases[i].ending);
        tests[i] = (struct CMUnitTest){name[i], test_format, NULL, NULL, (void *)(uintptr_t)&repair_cases[i]};
    }
    tests[n_repair_cases] = (struct CMUnitTest)cmocka_unit_test(test_slow_head);
    return _cmocka_run_group_tests("repair", tests, n_repair_cases + 1, set_up, tear_down);
}
