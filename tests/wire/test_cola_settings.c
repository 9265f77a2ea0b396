/* SPDX-License-Identifier: MIT */
/* CoLa: settings that mEEwriteall stores survive a reboot and a new start, where the configuration names a file; and a
 * link that speaks one dialect at a time. */
#include "tests/wire/cola_client.h"
#include "tests/wire/room.h"
#include "tests/wire/usage_rig.h"

static struct cola_client c;

/* The path stays good, unlike those of wire_path. */
static const char *config_write(const struct wire *wire, const char *links)
{
    static char path[400];
    const struct room_config config = {.profile = "sick-lms111", .prr_hz = 36000, .lines_hz = 50, .links = links};
    room_write(wire);
    snprintf(path, sizeof path, "%s", room_config_write(wire, &config));
    return path;
}

static struct head start_with_file(struct wire *wire, const char *config)
{
    char file[400];
    snprintf(file, sizeof file, "head.settings_file=%s", wire_path(wire, "settings.txt"));
    const char *const more[] = {"--set", file, NULL};
    const struct head head = head_start(wire, config, more);
    c = (struct cola_client){.fd = raw_connect(head_endpoint(&head, "tcp"))};
    return head;
}

static void log_in(void)
{
    cola_client_expect(&c, "sMN SetAccessMode 03 F4724744", "sAN SetAccessMode 1");
}

static void expect_stored(void)
{
    cola_client_expect(&c, "sRN LocationName", "sRA LocationName 4 yard");
    cola_client_expect(&c, "sRN FREchoFilter", "sRA FREchoFilter 2");
    cola_client_expect(&c, "sRN LMPscancfg", "sRA LMPscancfg 9C4 1 9C4 FFF92230 225510");
    cola_client_expect(&c, "sRN TSCTCupdatetime", "sRA TSCTCupdatetime 7");
    cola_client_expect(&c, "sRN TSCTCSrvAddr", "sRA TSCTCSrvAddr 7F 0 0 2");
}

static void stored_settings_survive(void **state)
{
    struct wire *wire = *state;
    const char *config = config_write(wire, "links: [{type: tcp, port: 0, protocol: cola}]\n");
    struct head head = start_with_file(wire, config);
    log_in();
    cola_client_expect(&c, "sMN mLMPsetscancfg +2500 +1 +2500 -450000 +2250000",
                       "sAN mLMPsetscancfg 0 9C4 1 9C4 FFF92230 225510");
    cola_client_expect(&c, "sWN LocationName 4 yard", "sWA LocationName");
    cola_client_expect(&c, "sWN FREchoFilter 2", "sWA FREchoFilter");
    cola_client_expect(&c, "sWN TSCTCupdatetime +7", "sWA TSCTCupdatetime");
    cola_client_expect(&c, "sWN TSCTCSrvAddr 7F 0 0 2", "sWA TSCTCSrvAddr");
    cola_client_expect(&c, "sMN mEEwriteall", "sAN mEEwriteall 1");
    cola_client_expect(&c, "sWN FREchoFilter 1", "sWA FREchoFilter"); /* these two are not stored */
    cola_client_expect(&c, "sWN TSCTCupdatetime +8", "sWA TSCTCupdatetime");
    cola_client_reboot(&c, &head);
    expect_stored();
    close(c.fd);
    head_end(&head, SIGTERM);
    head = start_with_file(wire, config); /* another process, of the same file */
    expect_stored();
    close(c.fd);
    head_end(&head, SIGTERM);
}

/* EIHstCola is in effect at once, on all sessions of the link and on no other link, and until power goes. */
static void a_link_has_one_dialect(void **state)
{
    struct wire *wire = *state;
    static const char ask_a[] = "\2sRN EIHstCola\3";
    static const uint8_t ask_b[] = "\2\2\2\2\0\0\0\x0dsRN EIHstCola\x2d",
                         is_b[] = "\2\2\2\2\0\0\0\x0fsRA EIHstCola \1\x03";
    uint8_t answer[sizeof is_b - 1];
    struct head head =
        start_with_file(wire, config_write(wire, "links: [{type: tcp, port: 0, protocol: cola, dialect: cola-a}, "
                                                 "{type: tcp, port: 0, protocol: cola, dialect: cola-a}]\n"));
    const int other_link = raw_connect(head_link(&head, 1)), other = raw_connect(head_link(&head, 0));
    raw_send(other, ask_b, sizeof ask_b - 1); /* in the wrong dialect: this gets no answer, and the next does */
    raw_send(other, ask_a, sizeof ask_a - 1);
    struct cola_client in_a = {.fd = other};
    assert_string_equal(cola_client_next(&in_a), "sRA EIHstCola 0");
    log_in();
    cola_client_expect(&c, "sWN EIHstCola 1", "sWA EIHstCola");
    raw_send(other, ask_a, sizeof ask_a - 1);
    raw_send(other, ask_b, sizeof ask_b - 1);
    for (size_t n = 0; n < sizeof answer;) {
        const ssize_t got = read(other, answer + n, sizeof answer - n);
        assert_true(got > 0);
        n += (size_t)got;
    }
    assert_memory_equal(answer, is_b, sizeof answer);
    in_a = (struct cola_client){.fd = other_link};
    cola_client_expect(&in_a, "sRN EIHstCola", "sRA EIHstCola 0");
    cola_client_expect(&in_a, "sMN SetAccessMode 03 F4724744", "sAN SetAccessMode 1");
    cola_client_reboot(&in_a, &head); /* on the first link again */
    cola_client_expect(&in_a, "sRN EIHstCola", "sRA EIHstCola 0");
    close(in_a.fd);
    close(other);
    close(c.fd);
    head_end(&head, SIGTERM);
}

/* A wrong line of the file ends the run at its start. */
static void a_wrong_line_is_found_at_the_start(void **state)
{
    struct wire *wire = *state;
    char set[400];
    snprintf(set, sizeof set, "head.settings_file=%s",
             wire_write_text(wire, "settings.txt", "scanhead settings 1\nprofile sick-lms111\ncola hello 7\nend\n"));
    const char *config = config_write(wire, "links: [{type: tcp, port: 0, protocol: cola}]\n");
    const char *const args[] = {"run", config, "--duration", "0.1", "--quiet", "--set", set, NULL};
    usage_expect(wire, "a wrong line of cola", args, 2,
                 (const char *const[]){"head.settings_file", "'hello 7' is no setting that cola stores", NULL});
    assert_int_equal(usage_complaints, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(stored_settings_survive, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_link_has_one_dialect, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_wrong_line_is_found_at_the_start, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("cola settings", tests, NULL, NULL);
}
