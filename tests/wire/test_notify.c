/* SPDX-License-Identifier: MIT */
/* $NOTIFY_SOCKET: the service manager gets READY=1 once the links are open, and STOPPING=1 when the end begins. The
 * test is the manager, with a socket of its own, by a path and by an abstract name. */
#include <stddef.h>
#include <sys/un.h>

#include "tests/wire/room.h"

static const struct room_config FRAME = {.prr_hz = 20000,
                                         .lines_hz = 20,
                                         .pan_deg_s = 90,
                                         .pan_stop_deg = 36,
                                         .frames = 1,
                                         .links = "links: [{type: tcp, port: 0}, {type: pty, path: port}]\n"};

/* Opens a datagram socket with this name, which the environment then has. An '@' stands for the NUL of an abstract
 * one. */
static int manager_open(const char *name)
{
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    socklen_t len = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + strlen(name) + (name[0] == '/'));
    assert_true(strlen(name) < sizeof at.sun_path);
    memcpy(at.sun_path, name, strlen(name));
    if (name[0] == '@') at.sun_path[0] = '\0';
    int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    assert_true(fd >= 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, len), 0);
    assert_int_equal(setenv("NOTIFY_SOCKET", name, 1), 0);
    return fd;
}

/* Returns the next datagram, which must come before the head ends. */
static const char *manager_next(int fd, pid_t head)
{
    static char text[4096];
    const int end = pidfd_open(head, 0);
    struct pollfd slot[] = {{.fd = fd, .events = POLLIN}, {.fd = end, .events = POLLIN}};
    assert_true(end >= 0);
    const int ready = poll(slot, 2, DEADLINE_MS);
    close(end);
    if (ready < 1) fail_msg("no datagram within %d ms", DEADLINE_MS);
    if (poll(slot, 1, 0) != 1) fail_msg("the head ended without a datagram");
    ssize_t n = recv(fd, text, sizeof text - 1, 0);
    assert_true(n > 0);
    text[n] = '\0';
    return text;
}

/* Nothing more has come. The head has ended, so that nothing is on its way. */
static void manager_close(int fd)
{
    char byte;
    assert_int_equal(recv(fd, &byte, 1, MSG_DONTWAIT), -1);
    assert_int_equal(errno, EAGAIN);
    close(fd);
    unsetenv("NOTIFY_SOCKET");
}

/* --ready-fd is not given here: only the manager knows when the head can be asked. */
static void hears_both(struct wire *wire, const char *name)
{
    char config[352], endpoint[128], pty[352];
    const int fd = manager_open(name);
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &FRAME));
    snprintf(pty, sizeof pty, "%s", wire_path(wire, "port"));
    const char *const args[] = {"run", config, NULL};
    struct head head = {.wire = wire, .pid = wire_spawn(wire, args, "out", "head.err", -1)};
    const char *ready = manager_next(fd, head.pid), *at = strstr(ready, "\nSTATUS=links open: tcp:");
    if (strncmp(ready, "READY=1\n", 8) != 0 || at == NULL) fail_msg("not ready: %s", ready);
    snprintf(endpoint, sizeof endpoint, "%.*s", (int)strcspn(strstr(at, "tcp:"), " "), strstr(at, "tcp:"));
    assert_non_null(strstr(at, pty));
    struct scanhead *sh = client_open(endpoint); /* at the first try */
    assert_non_null(strstr(client_ask(sh, "*IDN?"), "SIM-0001"));
    assert_int_equal(access(pty, R_OK | W_OK), 0);
    scanhead_close(sh);
    assert_int_equal(kill(head.pid, SIGTERM), 0);
    assert_string_equal(manager_next(fd, head.pid), "STOPPING=1\nSTATUS=ending");
    head_end(&head, 0);
    manager_close(fd);
}

static void test_socket_with_a_path(void **state)
{
    hears_both(*state, wire_path(*state, "notify"));
}

/* This also tries the longest name: 107 bytes with the '@'. */
static void test_abstract_socket(void **state)
{
    char name[sizeof((struct sockaddr_un *)0)->sun_path];
    snprintf(name, sizeof name, "@scanhead test %d", (int)getpid());
    hears_both(*state, name);
    size_t n = strlen(name);
    memset(name + n, 'x', sizeof name - 1 - n);
    name[sizeof name - 1] = '\0';
    hears_both(*state, name);
}

/* An end by itself is announced, too. */
static void test_end_by_itself(void **state)
{
    static const char *const more[] = {"--start", "--pace", "fast", "--frames", "1", NULL};
    struct wire *wire = *state;
    const int fd = manager_open(wire_path(wire, "notify"));
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &FRAME), more);
    assert_int_equal(strncmp(manager_next(fd, head.pid), "READY=1\n", 8), 0);
    assert_string_equal(manager_next(fd, head.pid), "STOPPING=1\nSTATUS=ending");
    head_end(&head, 0);
    manager_close(fd);
}

/* Checks the exit status, and that the messages have `says`. */
static void fails(struct wire *wire, int status, const char *says)
{
    char config[352];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    const char *const args[] = {"run", config, "--quiet", NULL};
    const int was = wire_wait(wire, wire_spawn(wire, args, "out", "head.err", -1));
    char *text = wire_read(wire_path(wire, "head.err"), NULL);
    if (was != status || strstr(text, says) == NULL) fail_msg("status %d, not %d with %s: %s", was, status, says, text);
    free(text);
}

/* One link can't be opened, so the head is never ready. */
static void test_not_ready_without_its_links(void **state)
{
    struct wire *wire = *state;
    struct room_config taken = FRAME;
    taken.links = "links: [{type: tcp, port: 0}, {type: pty, path: none/port}]\n";
    const int fd = manager_open(wire_path(wire, "notify"));
    room_write(wire);
    room_config_write(wire, &taken);
    fails(wire, 2, "none/port");
    manager_close(fd);
}

/* A manager that does not get the messages would end the head after its time. So the head ends at once, with the
 * reason. */
static void test_bad_sockets(void **state)
{
    static const struct {
        const char *name, *says;
        int status;
    } bad[] = {
        {"notify",
         "NOTIFY_SOCKET=notify: not the name of a socket; allowed are a path from / on and @NAME, 2 to 107 bytes", 2},
        {"@", "NOTIFY_SOCKET=@: not the name of a socket", 2},
        {"vsock:2:1234", "NOTIFY_SOCKET=vsock:2:1234: not the name of a socket", 2},
        {"/nowhere/notify", "NOTIFY_SOCKET=/nowhere/notify: No such file", 1}};
    char longer[109] = "@";
    memset(longer + 1, 'x', 107);
    room_write(*state);
    room_config_write(*state, &FRAME);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        setenv("NOTIFY_SOCKET", bad[i].name, 1);
        fails(*state, bad[i].status, bad[i].says);
    }
    setenv("NOTIFY_SOCKET", longer, 1);
    fails(*state, 2, "not the name of a socket");
    unsetenv("NOTIFY_SOCKET");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_socket_with_a_path, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_abstract_socket, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_end_by_itself, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_not_ready_without_its_links, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_bad_sockets, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
