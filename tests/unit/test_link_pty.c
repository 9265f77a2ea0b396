/* SPDX-License-Identifier: MIT */
/* These are tests of the pty link: one client after the other, and the path of its terminal. */
#include <sys/resource.h>
#include <sys/stat.h>
#include <termios.h>

#include "drivers/link/pty_device.h"
#include "tests/unit/pty_rig.h"

enum { OUTSIDER_UID = 65534 };

static void test_raw_both_ways(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    uint8_t out[4096], back[4096];
    for (size_t i = 0; i < sizeof out; i++) /* all values, at steps of 1, 2, .. 16 */
        out[i] = (uint8_t)(i * (1 + i / 256));
    assert_int_equal(bench.ops->write(bench.link, 0, out, 1), SH_ECLOSED); /* there is no client */
    int fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_write_all(&bench, 0, out, sizeof out);
    fd_read_all(fd, back, sizeof back);
    assert_memory_equal(out, back, sizeof out);
    memset(back, 0, sizeof back);
    assert_int_equal(write(fd, out, sizeof out), sizeof out);
    bench_read_all(&bench, 0, back, sizeof back);
    assert_memory_equal(out, back, sizeof out);
    /* There is no echo: written bytes do not come back, in either way. */
    int waiting = -1;
    assert_int_equal(ioctl(fd, FIONREAD, &waiting), 0);
    assert_int_equal(waiting, 0);
    bench.n_queue = 0;
    assert_true(is_calm(&bench, 0));
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    assert_int_equal(bench.ops->write(bench.link, 0, out, 1), SH_ECLOSED);
    assert_int_equal(bench.ops->read(bench.link, 0, out, 1), SH_ECLOSED);
    assert_true(is_calm(&bench, 1)); /* the master hangs up now, and must not keep us awake */
    bench_close(&bench);
}

static void test_full(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    int fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    for (int round = 0; round < 3; round++) {
        size_t held = bench_fill(&bench, 0);
        assert_true(held >= 4096);
        fd_drain(fd, held);
        bench_expect(&bench, LINK_WRITABLE, 1);
    }
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 1);
    bench_close(&bench);
}

/* The bytes that one client did not read, and its settings of the terminal, are gone for the next. */
static void test_fresh_for_next(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    struct termios cooked, seen;
    int fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_fill(&bench, 0);
    assert_int_equal(tcgetattr(fd, &cooked), 0);
    cooked.c_lflag |= ICANON | ECHO | ISIG;
    cooked.c_iflag |= ICRNL | IXON;
    cooked.c_oflag |= OPOST | ONLCR;
    assert_int_equal(tcsetattr(fd, TCSANOW, &cooked), 0);
    assert_int_equal(tcflow(fd, TCOOFF), 0); /* and stopped */
    assert_int_equal(ioctl(fd, TIOCEXCL), 0);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(tcgetattr(fd, &seen), 0);
    assert_int_equal(seen.c_lflag & (tcflag_t)(ICANON | ECHO | ISIG), 0);
    assert_int_equal(seen.c_iflag & (tcflag_t)(ICRNL | IXON), 0);
    assert_int_equal(seen.c_oflag & (tcflag_t)OPOST, 0);
    bench_write_all(&bench, 0, "fresh", 5);
    char text[16];
    assert_int_equal(read(fd, text, sizeof text), 5); /* the first bytes, and no others before */
    assert_memory_equal(text, "fresh", 5);
    assert_int_equal(write(fd, "q", 1), 1);
    bench_read_all(&bench, 0, text, 1);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

/* A client leaves while this process has no descriptors. The port rests all the same, and serves the next one. */
static void test_no_descriptors(void **state)
{
    (void)state;
    enum { HOGS = 64 };
    struct bench bench = bench_open(&plain);
    struct rlimit before, few;
    int hog[HOGS], n = 0, fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_fill(&bench, 0);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
    few = (struct rlimit){.rlim_cur = (rlim_t)fd + 8, .rlim_max = before.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &few), 0);
    close(fd);
    while (n < HOGS && (hog[n] = dup(STDERR_FILENO)) >= 0)
        n++;
    assert_true(n < HOGS);
    bench_expect(&bench, LINK_CLOSED, 0);
    assert_true(is_calm(&bench, 0));
    while (n > 0)
        close(hog[--n]);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
    fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_write_all(&bench, 0, "fresh", 5);
    char text[16];
    assert_int_equal(read(fd, text, sizeof text), 5);
    assert_memory_equal(text, "fresh", 5);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

/* echo '*RST' > /dev/pts/3 is over before the link looks, and still accepted. */
static void test_written_and_gone(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    for (int round = 0; round < 50; round++) {
        int fd = client_open(&bench);
        assert_int_equal(write(fd, "*RST\n", 5), 5);
        close(fd);
        bench_expect(&bench, LINK_OPENED, 0);
        assert_int_equal(read_to_end(&bench), 5);
        bench.n_queue = 0;
    }
    assert_true(is_calm(&bench, 1));
    bench_close(&bench);
}

/* The next client comes before the link looks, so there is never a hang-up to see. */
static void test_unseen_change(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    int fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    for (int round = 0; round < 50; round++) {
        bench_write_all(&bench, 0, "stale", 5);
        close(fd);
        fd = client_open(&bench);
        bench_expect(&bench, LINK_CLOSED, 0);
        bench_expect(&bench, LINK_OPENED, 0);
        char text[16];
        bench_write_all(&bench, 0, "new", 3);
        assert_int_equal(read(fd, text, sizeof text), 3);
        assert_memory_equal(text, "new", 3);
    }
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

/* Bytes still to be written for a client that is gone do not reach the one that came since. */
static void test_nothing_of_the_one_before(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    int fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    close(fd);
    fd = client_open(&bench);
    assert_int_equal(bench.ops->write(bench.link, 0, "stale", 5), 0);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_expect(&bench, LINK_OPENED, 0);
    int waiting = -1;
    assert_int_equal(ioctl(fd, FIONREAD, &waiting), 0);
    assert_int_equal(waiting, 0);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

static void link_path(struct link_spec *spec, const char *dir, const char *name)
{
    *spec = (struct link_spec){.type = LINK_PTY};
    snprintf(spec->path, sizeof spec->path, "%s/%s", dir, name);
}

static void expect_untouched(const struct link_spec *spec, const char *part)
{
    struct stat before, after;
    struct sh_err err = {0, ""};
    void *link = NULL;
    assert_int_equal(lstat(spec->path, &before), 0);
    assert_int_equal(link_ops_get(LINK_PTY)->open(spec, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, spec->path));
    assert_non_null(strstr(err.text, part));
    assert_null(strchr(err.text, '\n'));
    assert_int_equal(lstat(spec->path, &after), 0);
    assert_int_equal(before.st_ino, after.st_ino);
}

static void test_symlink(void **state)
{
    (void)state;
    char *dir = test_dir(), target[256], want[300];
    struct link_spec spec, other;
    struct stat st;
    link_path(&spec, dir, "scanner");
    assert_int_equal(symlink("/dev/pts/987654", spec.path), 0); /* left behind by a crash */
    struct bench bench = bench_open(&spec);
    ssize_t n = readlink(spec.path, target, sizeof target - 1);
    assert_true(n > 0);
    target[n] = '\0';
    assert_int_equal(stat(target, &st), 0);
    assert_true(S_ISCHR(st.st_mode));
    snprintf(want, sizeof want, "%s", spec.path);
    assert_string_equal(pty_path(&bench), want);
    int fd = client_open(&bench);
    bench_expect(&bench, LINK_OPENED, 0);
    expect_untouched(&spec, "another program"); /* a second head on the same path */
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
    assert_int_equal(lstat(spec.path, &st), -1); /* removed */

    bench = bench_open(&spec); /* on a path that is free */
    assert_int_equal(unlink(spec.path), 0);
    assert_int_equal(symlink("/dev/null", spec.path), 0); /* somebody else's now */
    bench_close(&bench);
    assert_int_equal(lstat(spec.path, &st), 0);
    expect_untouched(&spec, "exists");
    unlink(spec.path);

    link_path(&other, dir, "regular");
    fd = open(other.path, O_CREAT | O_WRONLY, 0600);
    assert_int_equal(write(fd, "data", 4), 4);
    close(fd);
    expect_untouched(&other, "not a symlink");
    unlink(other.path);
    link_path(&other, dir, "no/such/place");
    struct sh_err err = {0, ""};
    void *link = NULL;
    assert_int_equal(link_ops_get(LINK_PTY)->open(&other, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "no/such/place"));
    assert_int_equal(rmdir(dir), 0); /* and nothing lies about */
}

/* A head was killed, and another program has got its terminal's number. The symlink is older than that terminal. */
static void test_left_symlink(void **state)
{
    (void)state;
    char *dir = test_dir(), slave[64], target[256];
    struct link_spec spec;
    int master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_true(master >= 0 && grantpt(master) == 0 && unlockpt(master) == 0);
    assert_int_equal(ptsname_r(master, slave, sizeof slave), 0);
    link_path(&spec, dir, "scanner");
    assert_int_equal(symlink(slave, spec.path), 0);
    expect_untouched(&spec, "another program"); /* made for this terminal */
    const struct timespec old[2] = {{.tv_sec = 1000000000}, {.tv_sec = 1000000000}};
    assert_int_equal(utimensat(AT_FDCWD, spec.path, old, AT_SYMLINK_NOFOLLOW), 0);
    struct bench bench = bench_open(&spec);
    ssize_t n = readlink(spec.path, target, sizeof target - 1);
    assert_true(n > 0);
    target[n] = '\0';
    assert_string_not_equal(target, slave);
    bench_close(&bench);
    close(master);
    assert_int_equal(rmdir(dir), 0);
}

/* Ordinary users cannot open a terminal again on which a client left TIOCEXCL, so the head makes a new one. */
static void exclusive_child(const char *path)
{
    struct link_spec spec = {.type = LINK_PTY};
    snprintf(spec.path, sizeof spec.path, "%s", path);
    struct bench bench = bench_open(&spec);
    for (int round = 0; round < 3; round++) {
        int fd = client_open(&bench);
        bench_expect(&bench, LINK_OPENED, 0);
        assert_int_equal(ioctl(fd, TIOCEXCL), 0);
        assert_true(open(path, O_RDWR | O_NOCTTY) < 0 && errno == EBUSY);
        close(fd);
        bench_expect(&bench, LINK_CLOSED, 0);
    }
    bench_close(&bench);
}

/* Something has the name that a new symlink first gets. The device stays as it was, and no descriptor is left open. */
static void test_no_new_symlink(void **state)
{
    (void)state;
    char *dir = test_dir(), path[128], beside[160], before[64];
    struct pty_device device;
    struct sh_err err = {0};
    snprintf(path, sizeof path, "%s/scanner", dir);
    snprintf(beside, sizeof beside, "%s.%ld.tmp", path, (long)getpid());
    assert_int_equal(pty_device_open(&device, path, &err), SH_OK);
    const int master = device.master;
    snprintf(before, sizeof before, "%s", device.slave);
    assert_int_equal(mkdir(beside, 0700), 0);
    const int next = dup(STDERR_FILENO);
    close(next);
    assert_int_equal(pty_device_renew(&device), SH_EIO);
    const int same = dup(STDERR_FILENO);
    close(same);
    assert_int_equal(same, next);
    assert_int_equal(device.master, master);
    assert_string_equal(device.slave, before);
    assert_int_equal(rmdir(beside), 0);
    assert_int_equal(pty_device_renew(&device), SH_OK);
    assert_string_not_equal(device.slave, before);
    pty_device_close(&device);
    assert_int_equal(rmdir(dir), 0);
}

/* A user has removed the symlink. The symlink does not come back with a new terminal, nor at the end. The % in its name
 * is not taken as a format. */
static void test_removed_symlink(void **state)
{
    (void)state;
    char *dir = test_dir(), path[128];
    struct pty_device device;
    struct sh_err err = {0};
    struct stat st;
    const int n_open = count_open();
    snprintf(path, sizeof path, "%s/100%%dB", dir);
    assert_int_equal(pty_device_open(&device, path, &err), SH_OK);
    assert_string_equal(device.path, path);
    assert_int_equal(lstat(path, &st), 0);
    assert_int_equal(pty_device_renew(&device), SH_OK);
    assert_int_equal(lstat(path, &st), 0);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(pty_device_renew(&device), SH_OK);
    assert_int_equal(lstat(path, &st), -1);
    pty_device_close(&device);
    assert_int_equal(count_open(), n_open); /* one terminal after the other, and none at the end */
    assert_int_equal(rmdir(dir), 0);
}

static void test_exclusive(void **state)
{
    (void)state;
    char *dir = test_dir(), path[128];
    assert_int_equal(chmod(dir, 0777), 0);
    snprintf(path, sizeof path, "%s/scanner", dir);
    pid_t child = fork_child();
    if (child == 0) {
        if (geteuid() == 0 && setresuid(OUTSIDER_UID, OUTSIDER_UID, OUTSIDER_UID) != 0) _exit(2);
        exclusive_child(path);
        _exit(0);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    assert_int_equal(rmdir(dir), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_raw_both_ways),  cmocka_unit_test(test_full),
        cmocka_unit_test(test_fresh_for_next), cmocka_unit_test(test_written_and_gone),
        cmocka_unit_test(test_unseen_change),  cmocka_unit_test(test_nothing_of_the_one_before),
        cmocka_unit_test(test_no_descriptors), cmocka_unit_test(test_symlink),
        cmocka_unit_test(test_left_symlink),   cmocka_unit_test(test_removed_symlink),
        cmocka_unit_test(test_exclusive),      cmocka_unit_test(test_no_new_symlink),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
