/* SPDX-License-Identifier: MIT */
/* Campaigns that are killed and continued have the same bytes in the end. Changes made meanwhile are found, and nothing
 * is mixed. */
#include <sys/file.h>
#include <sys/inotify.h>

#include "tests/wire/batch_rig.h"

/* Waits for `n` events of files in the folder whose names have this ending. Returns 0 when the program ended
 * before. */
static int wait_for(int notify, pid_t pid, const char *ending, int n)
{
    char buf[8192] __attribute__((aligned(8)));
    const int end = pidfd_open(pid, 0);
    assert_true(end >= 0);
    while (n > 0) {
        struct pollfd on[2] = {{.fd = notify, .events = POLLIN}, {.fd = end, .events = POLLIN}};
        assert_true(poll(on, 2, DEADLINE_MS) > 0);
        const ssize_t got = on[0].revents != 0 ? read(notify, buf, sizeof buf) : 0;
        if (got <= 0) break;
        for (const char *at = buf; at < buf + got && n > 0;) {
            const struct inotify_event *event = (const void *)at;
            const size_t len = event->len > 0 ? strlen(event->name) : 0;
            if (len >= strlen(ending) && strcmp(event->name + len - strlen(ending), ending) == 0) n--;
            at += sizeof *event + event->len;
        }
    }
    close(end);
    return n == 0;
}

/* One campaign is killed once in each of these moments, one after the other. The shards differ each time. */
static const struct moment {
    const char *shard;
    uint32_t events;
    const char *ending;
    int n, signal;
} MOMENTS[] = {
    {"1/1", IN_CREATE, ".las.part", 1, SIGKILL}, /* within the first job */
    {"2/2", IN_MOVED_TO, ".ply", 1, SIGKILL},    /* one of its files is whole, the other one isn't */
    {"1/1", IN_MODIFY, ".jsonl", 1, SIGKILL},    /* a line is there */
    {"1/3", IN_CREATE, ".las.part", 1, SIGTERM}, /* asked to end, within a job */
    {"1/1", IN_CREATE, ".ply.part", 2, SIGKILL}, /* within the second of the jobs that were left */
};

static void test_killed(void **state)
{
    struct wire *wire = *state;
    assert_int_equal(mkdir(wire_path(wire, "killed"), 0700), 0);
    for (size_t i = 0; i < sizeof MOMENTS / sizeof MOMENTS[0]; i++) {
        const struct moment *m = &MOMENTS[i];
        const int notify = inotify_init1(IN_CLOEXEC);
        assert_true(inotify_add_watch(notify, wire_path(wire, "killed"), m->events) >= 0);
        const pid_t pid = batch_start(wire, "killed", WITH("--shard", m->shard, "--quiet"));
        const int came = wait_for(notify, pid, m->ending, m->n);
        if (came) kill(pid, m->signal);
        const int status = wire_wait(wire, pid);
        close(notify);
        /* 0 is right, too: the program may have ended before the signal came */
        assert_true(status == 0 || (came && status == (m->signal == SIGKILL ? 256 + SIGKILL : 1)));
        /* a file that has its final name is whole, whether it is in a manifest or not */
        for (int job = 0; job < BATCH_JOBS; job++)
            for (int k = 0; k < 2; k++) {
                const char *ending = k ? ".las" : ".ply";
                if (access(batch_file(wire, "killed", job, ending), F_OK) == 0)
                    batch_expect_same(batch_file(wire, "killed", job, ending), batch_file(wire, "ref", job, ending));
            }
    }
    batch_expect(wire, "killed", WITH("--shard", "1/2"), 0, "shard 1/2");
    batch_expect(wire, "killed", WITH("--shard", "2/2"), 0, "shard 2/2");
    batch_expect(wire, "killed", WITH("--merge"), 0, "6 jobs are complete");
    batch_expect_equal(wire, "killed", "ref");
}

/* After a signal while points are being written, nothing of the job is left. */
static void test_interrupted(void **state)
{
    struct wire *wire = *state;
    assert_int_equal(mkdir(wire_path(wire, "long"), 0700), 0);
    const int notify = inotify_init1(IN_CLOEXEC);
    assert_true(inotify_add_watch(notify, wire_path(wire, "long"), IN_MODIFY) >= 0);
    const pid_t pid = batch_start(wire, "long", WITH("--frames", "1000", "--quiet")); /* 10 million pulses */
    assert_true(wait_for(notify, pid, ".ply.part", 1));
    kill(pid, SIGTERM);
    assert_int_equal(wire_wait(wire, pid), 1);
    close(notify);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, "interrupted: 0 of 6 jobs of shard 1/1 are done"));
    free(err);
    assert_int_equal(unlink(batch_in(wire, "long", "manifest-1-of-1.jsonl")), 0);
    assert_int_equal(rmdir(wire_path(wire, "long")), 0);
}

/* A signal that comes once the last file of the last job is there leaves nothing to do, or that job: what is said and
 * the status agree. */
static void test_interrupted_at_the_end(void **state)
{
    struct wire *wire = *state;
    assert_int_equal(mkdir(wire_path(wire, "end"), 0700), 0);
    const int notify = inotify_init1(IN_CLOEXEC);
    assert_true(inotify_add_watch(notify, wire_path(wire, "end"), IN_MOVED_TO) >= 0);
    const pid_t pid = batch_start(wire, "end", WITH("--quiet"));
    assert_true(wait_for(notify, pid, ".las", BATCH_JOBS));
    kill(pid, SIGTERM);
    const int status = wire_wait(wire, pid);
    close(notify);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    if ((status == 0) != (strstr(err, "interrupted") == NULL) || strstr(err, "6 of 6") != NULL)
        fail_msg("status %d: %s", status, err);
    free(err);
}

/* ---- files that are not whole any more */

static void spoil(const struct wire *wire, int job, const char *ending, off_t cut, off_t flip)
{
    const char *path = batch_file(wire, "one", job, ending);
    struct stat st;
    assert_int_equal(stat(path, &st), 0);
    if (cut != 0) assert_int_equal(truncate(path, st.st_size - cut), 0);
    if (flip == 0) return;
    char c;
    const int fd = open(path, O_RDWR | O_CLOEXEC);
    assert_int_equal(pread(fd, &c, 1, st.st_size - flip), 1);
    c ^= 1;
    assert_int_equal(pwrite(fd, &c, 1, st.st_size - flip), 1);
    close(fd);
}

static void test_spoilt(void **state)
{
    struct wire *wire = *state;
    batch_whole(wire, "one");
    spoil(wire, 0, ".ply", 1, 0);
    spoil(wire, 2, ".las", 0, 9);
    assert_int_equal(unlink(batch_file(wire, "one", 3, ".ply")), 0);
    /* One line is cut short, and a part of a file is left. */
    struct stat st;
    assert_int_equal(stat(batch_in(wire, "one", "manifest-1-of-1.jsonl"), &st), 0);
    assert_int_equal(truncate(batch_in(wire, "one", "manifest-1-of-1.jsonl"), st.st_size - 2), 0);
    FILE *part = fopen(batch_file(wire, "one", 5, ".ply.part"), "w");
    assert_true(part != NULL && fputs("ply\n", part) >= 0 && fclose(part) == 0);
    batch_expect(wire, "one", WITH("--merge"), 1, "job 1, ");
    char *err = wire_read(wire_path(wire, "err"), NULL);
    for (const char *const *says = WITH("bytes, but had", "job 3, ", "(sha256)", "job 4, ", "is missing", "job 6, ",
                                        ": missing", "4 of 6 jobs");
         *says != NULL; says++)
        if (strstr(err, *says) == NULL) fail_msg("no \"%s\" in: %s", *says, err);
    assert_null(strstr(err, "job 2, "));
    free(err);
    batch_expect(wire, "one", NULL, 0, "6 jobs done, 4 of them now");
    assert_int_not_equal(access(batch_in(wire, "one", "manifest.json"), F_OK), 0); /* it was out of date */
    batch_expect(wire, "one", WITH("--merge"), 0, "6 jobs are complete");
    batch_expect_equal(wire, "one", "ref");
    batch_expect(wire, "one", NULL, 0, "6 jobs done, 0 of them now");
    assert_int_equal(access(batch_in(wire, "one", "manifest.json"), F_OK), 0);
}

/* Each change is refused until it is undone; --force makes the jobs again. */
static void test_nothing_is_mixed(void **state)
{
    struct wire *wire = *state;
    char manifest[352], engine[128];
    assert_int_equal(batch_call(wire, "one", WITH("--shard", "1/3", "--quiet")), 0);
    batch_expect(wire, "one", WITH("--list"), 0, "");
    char *list = wire_read(wire_path(wire, "out"), NULL);
    const char *second = strchr(list, '\n') + 1;
    assert_memory_equal(list, "done 0001_station-1_head.prr_hz=100000 station 1 head.prr_hz=100000\n",
                        (size_t)(second - list));
    assert_memory_equal(second, "-    0002_", 10);
    free(list);
    /* settings of the computing's speed are no part of a job */
    batch_expect(wire, "one", WITH("--set", "loop.queue_ms=100", "--list"), 0, "");
    list = wire_read(wire_path(wire, "out"), NULL);
    assert_memory_equal(list, "done ", 5);
    free(list);
    batch_change(wire_path(wire, "config.yaml"), "1.5]", "1.6]");
    batch_expect(wire, "one", WITH("--shard", "2/3"), 1, "another text of the configuration");
    batch_expect(wire, "one", WITH("--merge"), 1, "another text of the configuration");
    batch_change(wire_path(wire, "config.yaml"), "1.6]", "1.5]");
    batch_change(wire_path(wire, "room.obj"), "\nv ", "\n# moved\nv ");
    batch_expect(wire, "one", WITH("--shard", "2/3"), 1, "mesh");
    batch_change(wire_path(wire, "room.obj"), "\n# moved\nv ", "\nv ");
    batch_expect(wire, "one", WITH("--set", "noise.seed=5"), 1, "values of keys");
    batch_expect(wire, "one", WITH("--stations", "2"), 1, "another station");
    batch_expect(wire, "one", WITH("--colour", "label"), 1, "other options");
    snprintf(manifest, sizeof manifest, "%s", batch_in(wire, "one", "manifest-1-of-3.jsonl"));
    char *text = wire_read(manifest, NULL), *at = strstr(text, "\"engine\":\"");
    assert_non_null(at);
    snprintf(engine, sizeof engine, "%.*s", (int)strcspn(at + 10, "\""), at + 10);
    free(text);
    batch_change(manifest, engine, "Embree 3.0.0, packets of 2, abacus");
    batch_expect(wire, "one", WITH("--shard", "2/3"), 1, "processor");
    /* --merge finds that the shards come from two kinds of processor, wherever it runs */
    batch_expect(wire, "one", WITH("--force", "--shard", "2/3"), 0, "shard 2/3");
    batch_expect(wire, "one", WITH("--merge"), 1, "abacus");
    batch_change(manifest, "Embree 3.0.0, packets of 2, abacus", engine);
    batch_change(manifest, "\"program\":\"", "\"program\":\"0.");
    batch_expect(wire, "one", WITH("--shard", "2/3"), 1, "release");
    batch_expect(wire, "one", WITH("--force", "--quiet"), 0, "");
    batch_expect(wire, "one", WITH("--merge"), 0, "6 jobs are complete");
    assert_int_equal(link(batch_file(wire, "one", 0, ".ply"), batch_in(wire, "one", "0001_before.ply")), 0);
    batch_expect(wire, "one", WITH("--merge"), 0,
                 "1 files belong to no job of this campaign, the first: 0001_before.ply");
}

/* ---- other processes at work, and jobs that fail */

static void test_locked(void **state)
{
    struct wire *wire = *state;
    assert_int_equal(batch_call(wire, "one", WITH("--shard", "1/2", "--quiet")), 0);
    const int fd = open(batch_in(wire, "one", "manifest-2-of-2.jsonl"), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    assert_int_equal(flock(fd, LOCK_EX | LOCK_NB), 0);
    batch_expect(wire, "one", WITH("--shard", "2/2"), 1, "another process does shard 2/2");
    close(fd);
    batch_expect(wire, "one", WITH("--shard", "2/2"), 0, "3 jobs done, 3 of them now");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_killed, batch_setup_with_ref, batch_teardown),
        cmocka_unit_test_setup_teardown(test_interrupted, batch_setup, batch_teardown),
        cmocka_unit_test_setup_teardown(test_interrupted_at_the_end, batch_setup, batch_teardown),
        cmocka_unit_test_setup_teardown(test_spoilt, batch_setup_with_ref, batch_teardown),
        cmocka_unit_test_setup_teardown(test_nothing_is_mixed, batch_setup, batch_teardown),
        cmocka_unit_test_setup_teardown(test_locked, batch_setup, batch_teardown),
    };
    return cmocka_run_group_tests(tests, batch_make_ref, batch_remove_ref);
}
