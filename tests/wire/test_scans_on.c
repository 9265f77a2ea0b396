/* SPDX-License-Identifier: MIT */
/* A head whose link speaks as a device that scans until it is stopped. `run` gives its scan no last frame, unless the
 * configuration or the command line gives head.frames. */
#include <poll.h>

#include "tests/wire/room.h"

static const char CONFIG[] = "head: {profile: hokuyo-utm-30lx}\n"
                             "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
                             "stations: [{position_m: [0, 0, 0]}]\n"
                             "links: [{type: tcp, port: 0, protocol: scip}, {type: pty, path: native}]\n";

static struct head start(struct wire *wire, const char *set)
{
    const char *const more[] = {"--pace", "step", set != NULL ? "--set" : NULL, set, NULL};
    room_write(wire);
    return head_start(wire, wire_write_text(wire, "config.yaml", CONFIG), more);
}

struct replies {
    char text[4096];
    size_t len;
};

static void read_up_to(int fd, const char *piece, struct replies *to)
{
    while (strstr(to->text, piece) == NULL) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        const ssize_t got = read(fd, to->text + to->len, sizeof to->text - 1 - to->len);
        assert_true(got > 0);
        to->text[to->len += (size_t)got] = '\0';
    }
}

/* Of five scans each one comes, and the last one says that none is left. */
static void a_client_gets_all_its_scans(void **state)
{
    struct wire *wire = *state;
    static const char request[] = "MD0500050001005\n";
    static struct replies replies;
    struct head head = start(wire, NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "pty"));
    assert_string_equal(client_ask(sh, "SCAN:FRAM?"), "0");
    client_tell(sh, "TIME:STEP 3 S"); /* to the end of the boot */
    client_tell(sh, "SCAN:STAR");     /* the session that grants time has control, so SCIP can't start the head */
    const int fd = raw_connect(head_endpoint(&head, "tcp"));
    raw_send(fd, request, sizeof request - 1);
    read_up_to(fd, "MD0500050001005\n00P\n", &replies);
    client_tell(sh, "TIME:STEP 2 S"); /* more than the spin-up and six turns of 25 ms */
    for (int left = 4; left >= 0; left--) {
        char reply[32];
        snprintf(reply, sizeof reply, "MD050005000100%d\n99b\n", left);
        read_up_to(fd, reply, &replies);
    }
    close(fd);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

static void a_number_that_is_given_counts(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "head.frames=1");
    struct scanhead *sh = client_open(head_endpoint(&head, "pty"));
    assert_string_equal(client_ask(sh, "SCAN:FRAM?"), "1");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_client_gets_all_its_scans, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_number_that_is_given_counts, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
