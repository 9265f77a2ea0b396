/* SPDX-License-Identifier: MIT */
/* Damaged recordings, files that are no recordings, and hostile ones. */
#include "tests/wire/replay_rig.h"

#include "drivers/protocol/native_encode.h"

static char file[352];

static void record(struct wire *wire, const char *name)
{
    snprintf(file, sizeof file, "%s", replay_room(wire, name, 30));
}

static void test_cut_and_bad_bytes(void **state)
{
    struct wire *wire = *state;
    static const char *const quiet[] = {NULL};
    size_t n;
    record(wire, "head.shs");
    char *bytes = wire_read(file, &n);
    snprintf(file, sizeof file, "%s", wire_write(wire, "cut.shs", bytes, n - 20));
    replay_to_file(wire, file, quiet, "out.shs");
    replay_said(wire, "bytes left out, which belong to no complete frame; its end is cut off");
    replay_same_file(wire, "out.shs", "cut.shs");
    bytes[n / 2] ^= 1;
    memset(bytes + n / 3, 0x55, 400);
    snprintf(file, sizeof file, "%s", wire_write(wire, "bad.shs", bytes, n));
    free(bytes);
    replay_to_file(wire, file, quiet, "out.shs");
    replay_said(wire, "bytes left out, which belong to no complete frame");
    replay_same_file(wire, "out.shs", "bad.shs");
}

/* A whole frame in the middle has a version of later times. Each reader leaves out that frame alone: a replay, which
 * says so, and a recorder, whose recording is then not complete. */
static void test_another_version(void **state)
{
    struct wire *wire = *state;
    static const char *const quiet[] = {NULL};
    struct tape all = {0}, rest = {0};
    uint32_t i = 0;
    size_t n;
    record(wire, "head.shs");
    char *bytes = wire_read(file, &n);
    tape_read(file, &all);
    while (all.frame[i].type != NATIVE_POINTS || i < all.n / 2)
        i++;
    bytes[all.frame[i].at + 2] = NATIVE_VERSION + 1;
    native_finish_frame((uint8_t *)bytes + all.frame[i].at, all.frame[i].seq);
    snprintf(file, sizeof file, "%s", wire_write(wire, "later.shs", bytes, n));
    free(bytes);
    replay_to_file(wire, file, quiet, "out.shs");
    replay_said(wire, "1 frames left out, which have wrong contents or another version");
    tape_read(wire_path(wire, "out.shs"), &rest);
    assert_int_equal(rest.n, all.n - 1);
    assert_memory_equal(rest.bytes, all.bytes, all.frame[i].at);
    assert_memory_equal(rest.bytes + all.frame[i].at, all.bytes + all.frame[i].at + all.frame[i].len,
                        all.len - all.frame[i].at - all.frame[i].len);
    char ply[352], where[64];
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "out.ply"));
    const char *const args[] = {"record", file, "-o", ply, NULL};
    assert_int_equal(replay_call(wire, args), 1);
    snprintf(where, sizeof where, "frame %u at byte %zu is left out: ", (unsigned)all.frame[i].seq, all.frame[i].at);
    replay_said(wire, where);
    replay_said(wire, "is not complete: 1 frames lost to this reader (1 for their contents or version)");
    assert_int_equal(access(ply, R_OK), 0);
    tape_free(&all);
    tape_free(&rest);
}

/* The error is one line. The status is 2 for a file that is no recording, as for one that can't be opened. */
static void refused(struct wire *wire, const char *path, const char *why)
{
    char link[400];
    snprintf(link, sizeof link, "type: file, path: '%s'", wire_path(wire, "out.shs"));
    const char *const args[] = {"run", path, "--start", "--pace", "fast", "--link", link, NULL};
    assert_int_equal(replay_call(wire, args), 2);
    replay_said(wire, why);
    char *text = wire_read(wire_path(wire, "err"), NULL);
    if (strchr(text, '\n') == NULL || strchr(text, '\n')[1] != '\0') fail_msg("more than a line: %s", text);
    free(text);
}

static void test_no_recordings(void **state)
{
    struct wire *wire = *state;
    struct tape tape = {0};
    uint8_t pcapng[28 + 20 + 96] = {0x0a, 0x0d, 0x0d, 0x0a, 28,   0,    0,    0,    0x4d, 0x3c, 0x2b, 0x1a, 1,
                                    0,    0,    0,    0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 28};
    static const uint8_t interface[20] = {1, 0, 0, 0, 20, 0, 0, 0, 1, 0, 0, 0, 0xff, 0xff, 0, 0, 20};
    static const uint8_t packet[28] = {6, 0, 0, 0, 96, [20] = 64, [24] = 64};
    memcpy(pcapng + 28, interface, sizeof interface);
    memcpy(pcapng + 48, packet, sizeof packet);
    pcapng[140] = 96;
    refused(wire, wire_write(wire, "empty.shs", "", 0), "it has no descriptor");
    refused(wire, wire_write_text(wire, "text.shs", "head: {profile: any-rate}\nlinks: []\n"), "not");
    refused(wire, wire_write(wire, "ethernet.pcapng", pcapng, sizeof pcapng), "no device sends anything");
    refused(wire, wire_path(wire, "none.shs"), "cannot open");
    mkdir(wire_path(wire, "folder.shs"), 0700);
    refused(wire, wire_path(wire, "folder.shs"), "is a directory");
    record(wire, "head.shs");
    tape_read(file, &tape);
    uint32_t i = 0;
    while (tape.frame[i].type != SCANHEAD_DESCRIPTOR)
        i++;
    const size_t at = tape.frame[i + 1].at;
    refused(wire, wire_write(wire, "late.shs", tape.bytes + at, tape.len - at), "it has no descriptor");
    tape_free(&tape);
}

/* A descriptor has absurd numbers, with right checksums. The recording is served all the same, at once. */
static void test_absurd_numbers(void **state)
{
    struct wire *wire = *state;
    static const char *const fast[] = {NULL};
    struct native_descriptor d;
    struct tape tape = {0};
    uint32_t i = 0;
    record(wire, "head.shs");
    tape_read(file, &tape);
    while (tape.frame[i].type != SCANHEAD_DESCRIPTOR)
        i++;
    uint8_t *frame = tape.bytes + tape.frame[i].at;
    assert_int_equal(native_decode_descriptor(frame + NATIVE_HEADER_LEN, tape.frame[i].len - NATIVE_HEADER_LEN, &d), 0);
    static const uint64_t any[] = {0, 1, UINT64_MAX, INT64_MAX, UINT64_C(1) << 63};
    for (size_t k = 0; k < sizeof any / sizeof *any; k++) {
        d.prr_uhz = d.lines_uhz = d.pan_udeg_s = any[k];
        d.sweep_udeg = (int64_t)any[k];
        assert_int_equal(native_encode_descriptor(frame, tape.frame[i].len, &d, tape.frame[i].t_ns, 0),
                         tape.frame[i].len);
        native_finish_frame(frame, tape.frame[i].seq);
        tape_write(wire, "absurd.shs", &tape);
        snprintf(file, sizeof file, "%s", wire_path(wire, "absurd.shs"));
        replay_to_file(wire, file, fast, "out.shs");
        replay_same_file(wire, "out.shs", "absurd.shs");
    }
    tape_free(&tape);
}

/* A stranger's recording can't write commands to the terminal, nor lines of its own. */
static void test_hostile_name(void **state)
{
    struct wire *wire = *state;
    struct native_descriptor d;
    struct tape tape = {0};
    record(wire, "head.shs");
    tape_read(file, &tape);
    for (uint32_t i = 0; i < tape.n; i++) {
        uint8_t *frame = tape.bytes + tape.frame[i].at;
        if (tape.frame[i].type != SCANHEAD_DESCRIPTOR) continue;
        const size_t len = tape.frame[i].len - NATIVE_HEADER_LEN;
        assert_int_equal(native_decode_descriptor(frame + NATIVE_HEADER_LEN, len, &d), 0);
        memcpy(d.idn, "\n\033]2;", 5);
        assert_int_equal(native_encode_descriptor(frame, tape.frame[i].len, &d, tape.frame[i].t_ns, 0),
                         tape.frame[i].len);
        native_finish_frame(frame, tape.frame[i].seq);
    }
    const char *const args[] = {
        "run", tape_write(wire, "hostile.shs", &tape), "--start", "--pace", "fast", "--link", "null", NULL};
    assert_int_equal(replay_call(wire, args), 0);
    char *text = wire_read(wire_path(wire, "err"), NULL), *line = strstr(text, "hostile.shs: ");
    assert_null(strchr(text, '\033'));
    assert_non_null(line);
    line[strcspn(line, "\n")] = '\0';
    assert_non_null(strstr(line, "]2;")); /* it is one line */
    free(text);
    tape_free(&tape);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_cut_and_bad_bytes, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_another_version, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_no_recordings, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_absurd_numbers, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_hostile_name, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
