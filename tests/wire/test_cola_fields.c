/* SPDX-License-Identifier: MIT */
/* A TiM781 watches fields of its configuration: a client polls the results and gets the changes. Faults make them
 * change: a laser that is off, and a soiled window. */
#include "tests/wire/cola_client.h"
#include "tests/wire/room.h"
#include "tests/wire/wire.h"

/* Waits for a telegram that begins so. */
static const char *wait_for(struct cola_client *c, const char *begin)
{
    const char *text;
    do {
        text = cola_client_next(c);
        assert_non_null(text);
    } while (strncmp(text, begin, strlen(begin)) != 0);
    return text;
}

/* The results of LFErec as "210". Each of three records has 19 values in CoLa-A, the last 7 of them the time. */
static void read_results(const char *telegram, char results[4])
{
    const char *at = telegram;
    for (int i = 0; i < 3; i++) /* verb, name, count */
        at = strchr(at, ' ') + 1;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 19; i++, at = strchr(at, ' ') != NULL ? strchr(at, ' ') + 1 : at)
            if (i == 7) results[k] = *at;
    results[3] = '\0';
}

static void poll_until(struct cola_client *c, const char *request, const char *answer)
{
    do
        cola_client_send(c, request);
    while (strcmp(wait_for(c, "sRA "), answer) != 0);
}

/* The head stands in a closed room, so that the walls are in the one field and not in the other. No signal is modelled:
 * LCMstate alone shows that the window is soiled. */
static struct head start(struct wire *wire)
{
    const struct room_config config = {
        .profile = "sick-tim781",
        .prr_hz = 16200,
        .lines_hz = 15,
        .links = "loop: {queue_ms: 2000}\n"
                 "links: [{type: tcp, port: 0, protocol: cola}, {type: pty, path: native}]\n",
        .more = "fields:\n"
                "  - {number: 1, name: walls, shape: segment, angles_deg: [-45, 225], radii_m: [0, 20]}\n"
                "  - {number: 2, name: near, shape: rectangle, corner_m: [-0.2, -0.2], size_m: [0.4, 0.4]}\n"};
    room_write(wire);
    return head_start(wire, room_config_write(wire, &config), NULL);
}

static void fields_and_the_window(void **state)
{
    struct wire *wire = *state;
    static struct cola_client c;
    char results[4];
    struct head head = start(wire);
    struct scanhead *native = client_open(head_endpoint(&head, "pty"));
    c.fd = raw_connect(head_endpoint(&head, "tcp"));
    cola_client_send(&c, "sEN LFErec 1");
    cola_client_send(&c, "sEN LIDoutputstate 1");
    cola_client_send(&c, "sMN SetAccessMode 03 F4724744");
    wait_for(&c, "sAN SetAccessMode 1");
    cola_client_send(&c, "sMN LMCstartmeas");
    read_results(wait_for(&c, "sSN LFErec 3 "), results);
    assert_string_equal(results, "210");
    assert_non_null(strstr(wait_for(&c, "sSN LIDoutputstate 0 "), " 1 1 0 0 0 0 0 0 0 0 0"));
    static struct cola_client late; /* its first answer has what was seen before this client came */
    late.fd = raw_connect(head_endpoint(&head, "tcp"));
    cola_client_send(&late, "sRN LFErec");
    read_results(wait_for(&late, "sRA LFErec 3 "), results);
    assert_string_equal(results, "210");
    close(late.fd);
    poll_until(&c, "sRN LCMstate", "sRA LCMstate 0");
    const long soiled = strtol(client_ask(native, "FAULt:ADD {kind: window_soiled, loss_db: 3}"), NULL, 10);
    assert_true(soiled > 0);
    poll_until(&c, "sRN LCMstate", "sRA LCMstate 2");
    char line[40];
    snprintf(line, sizeof line, "FAULt:CLEar %ld", soiled);
    assert_string_equal(client_ask(native, line), "OK");
    poll_until(&c, "sRN LCMstate", "sRA LCMstate 0");
    client_ask(native, "FAULt:ADD {kind: laser_off}");
    read_results(wait_for(&c, "sSN LFErec 3 "), results);
    assert_string_equal(results, "110"); /* shots without echo are no objects */
    assert_non_null(strstr(wait_for(&c, "sSN LIDoutputstate 0 "), " 0 1 0 0 0 0 0 0 0 0 0"));
    close(c.fd);
    scanhead_close(native);
    head_end(&head, SIGTERM);
}

/* A session also looks at what was seen before its client came, though the client never received that. */
static void received_is_from_the_first_moment_on(void **state)
{
    struct wire *wire = *state;
    static struct cola_client c;
    uint64_t before = 0;
    struct head head = start(wire);
    struct scanhead *native = client_open(head_endpoint(&head, "pty"));
    struct scanhead_frame frame;
    client_wait_state(native, "idle");
    client_tell(native, "SCAN:START");
    while (before < 5000) { /* a third of a second, and the session looks back for one and a half */
        client_next(native, &frame);
        before += frame.n_pulses;
    }
    c.fd = raw_connect(head_endpoint(&head, "tcp"));
    cola_client_send(&c, "sRN LFErec");
    wait_for(&c, "sRA LFErec 3 ");
    close(c.fd);
    scanhead_close(native);
    head_end(&head, SIGTERM);
    assert_in_range(stats_link_uint(wire, "received_pulses"), 0, stats_uint(wire, "pulses") - before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(fields_and_the_window, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(received_is_from_the_first_moment_on, wire_setup, wire_teardown)};
    return cmocka_run_group_tests_name("cola fields", tests, NULL, NULL);
}
