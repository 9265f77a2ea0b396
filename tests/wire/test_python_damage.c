/* SPDX-License-Identifier: MIT */
/* The client in Python with streams that were damaged, hostile ones, ends, and wrong calls. */
#include "tests/common/thorough.h"
#include "tests/wire/python_rig.h"

#include <nettle/sha2.h>

#include "drivers/protocol/native_encode.h"

enum { ROUNDS = 6 };

static uint32_t dice;
static uint32_t roll(uint32_t n)
{
    dice = dice * 1664525u + 1013904223u;
    return (dice >> 8) % n;
}

/* Copies with damage: some bytes are lost, some changed, and sync bytes and replies are put in between. */
static size_t damage(uint8_t *to, const uint8_t *from, size_t len)
{
    size_t n = 0;
    for (size_t i = 0; i < len; i++) {
        uint32_t fate = roll(3000);
        if (fate < 2) i += roll(700);
        if (fate == 2) to[n++] = 0xd5;
        if (fate == 3) n += (size_t)sprintf((char *)to + n, "OK\r\n");
        if (i < len) to[n++] = fate == 4 ? (uint8_t)roll(256) : from[i];
    }
    return n;
}

/* Repeats the stream as one whose numbers run over 2^32. */
static size_t prolong(uint8_t *to, const char *from, size_t len)
{
    uint32_t seq = 0u - 100u;
    for (int i = 0; i < ROUNDS; i++)
        memcpy(to + (size_t)i * len, from, len);
    for (size_t at = 0; at < ROUNDS * len; at += native_frame_len(to + at))
        native_finish_frame(to + at, seq++);
    return ROUNDS * len;
}

/* Repeats some frames, and moves some behind others. */
static size_t shuffle(uint8_t *to, const uint8_t *from, size_t len)
{
    struct late {
        size_t at, len;
        uint32_t left;
    } late[64] = {{0, 0, 0}};
    size_t n = 0;
    for (size_t at = 0, frame; at < len; at += frame) {
        frame = native_frame_len(from + at);
        const uint32_t fate = roll(20), slot = roll(64);
        for (int i = 0; i < 64; i++) {
            if (late[i].len == 0 || late[i].left-- > 0) continue;
            memcpy(to + n, from + late[i].at, late[i].len);
            n += late[i].len;
            late[i].len = 0;
        }
        if (fate < 2 && late[slot].len == 0) late[slot] = (struct late){at, frame, roll(30)};
        if (fate == 0 && late[slot].at == at && late[slot].len > 0) continue; /* it comes later */
        memcpy(to + n, from + at, frame);
        n += frame;
    }
    return n;
}

struct said {
    struct sha256_ctx sha256;
    uint32_t n;
};

static void on_notice(void *ctx, const struct scanhead_notice *notice)
{
    struct said *said = ctx;
    char line[128];
    const int n = snprintf(line, sizeof line, "%s %llu %u %llu %lld\n", scanhead_notice_name((int)notice->kind),
                           (unsigned long long)notice->at_byte, notice->seq, (unsigned long long)notice->n,
                           notice->t_ns == SCANHEAD_NO_TIME ? 0LL : (long long)notice->t_ns);
    sha256_update(&said->sha256, (size_t)n, (const uint8_t *)line);
    said->n++;
}

static void put_counts(char *text, size_t room, const struct scanhead_stats *s, struct said *said)
{
    uint8_t digest[SHA256_DIGEST_SIZE];
    sha256_digest(&said->sha256, sizeof digest, digest);
    int n =
        snprintf(text, room, "%llu %llu %llu %llu %llu %llu %llu %llu %llu %llu ", (unsigned long long)s->bytes,
                 (unsigned long long)s->frames, (unsigned long long)s->bad_payload, (unsigned long long)s->bad_bytes,
                 (unsigned long long)s->seq_gaps, (unsigned long long)s->seq_lost, (unsigned long long)s->repeated,
                 (unsigned long long)s->late, (unsigned long long)s->restarts, (unsigned long long)s->cuts);
    for (size_t i = 0; i < sizeof digest; i++)
        n += snprintf(text + n, room - (size_t)n, "%02x", digest[i]);
    snprintf(text + n, room - (size_t)n, "\n");
}

static void test_damaged(void **state)
{
    struct wire *wire = *state;
    need_python();
    room_write(wire);
    size_t len;
    char *bytes = wire_read(record(wire, &SMALL, "a.shs", ""), &len);
    uint8_t *longer = malloc(ROUNDS * len), *shuffled = malloc(2 * ROUNDS * len), *out = malloc(4 * ROUNDS * len + 16);
    const size_t longer_len = prolong(longer, bytes, len);
    for (dice = 1; dice < (uint32_t)thorough(3, 2); dice++) {
        const uint32_t seed = dice;
        const size_t n = shuffle(shuffled, longer, longer_len);
        const char *path = wire_write(wire, "b.shs", out, damage(out, shuffled, n));
        struct said said = {.n = 0};
        sha256_init(&said.sha256);
        struct scanhead_stats stats;
        struct scanhead_frame frame;
        struct scanhead *sh = client_open(path);
        scanhead_on_notice(sh, on_notice, &said);
        while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK)
            continue;
        scanhead_get_stats(sh, &stats);
        char want[384], file[352];
        put_counts(want, sizeof want, &stats, &said);
        scanhead_close(sh);
        snprintf(file, sizeof file, "%s", wire_path(wire, "b.shs"));
        assert_string_equal(ask_python(wire, "plain", "count", file, NULL), want);
        assert_true(stats.seq_gaps > 10 && stats.repeated > 1 && stats.late > 1 && said.n > 50);
        dice = seed;
    }
    free(out);
    free(shuffled);
    free(longer);
    free(bytes);
}

static void test_notices(void **state)
{
    need_python();
    assert_string_equal(ask_python(*state, "plain", "notices", NULL, NULL), "noticed\n");
}

static void test_hostile(void **state)
{
    struct wire *wire = *state;
    static const char *const seeds[] = {"1", "2"};
    need_python();
    room_write(wire);
    write_ride(wire);
    char path[352];
    snprintf(path, sizeof path, "%s",
             record(wire, &RIDE, "a.shs",
                    "output.attributes=on signal.model=on waveform.send=on waveform.echoes=fraction noise.range=off"));
    for (int k = 0; k < 2; k++) {
        unsigned taken, refused;
        const char *said = ask_python(wire, flavours[k], "hostile", path, seeds[k]);
        if (said == NULL) continue;
        assert_int_equal(sscanf(said, "%u %u", &taken, &refused), 2);
        assert_true(taken > 200 && refused > 100);
    }
}

static void test_ends(void **state)
{
    need_python();
    assert_string_equal(ask_python(*state, "plain", "ends", wire_path(*state, "ends.shs"), NULL), "ends\n");
}

static void test_misuse(void **state)
{
    need_python();
    const char *path = wire_write(*state, "a.shs", "", 0);
    assert_string_equal(ask_python(*state, "plain", "misuse", path, NULL), "refused\n");
}

/* The module as a program: a file that is no recording is an error, with the status that scanhead has for it. */
static void test_no_recording(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *file, *text, *says;
    } rows[] = {{"empty.shs", "", "empty.shs: no frame in 0 bytes: "},
                {"junk.shs", "not a stream\n", "junk.shs: no frame in 13 bytes: "},
                {"none.shs", NULL, "none.shs: No such file"}};
    need_python();
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        if (rows[i].text != NULL) wire_write_text(wire, rows[i].file, rows[i].text);
        const char *const args[] = {"drivers/host/python/scanhead.py", wire_path(wire, rows[i].file), NULL};
        wire_run_program(wire, python, args, 2);
        char *out = wire_read(wire_path(wire, "out"), NULL), *err = wire_read(wire_path(wire, "err"), NULL);
        assert_string_equal(out, "");
        assert_non_null(strstr(err, rows[i].says));
        free(out);
        free(err);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_damaged, setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_notices, setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_hostile, setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_ends, setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_misuse, setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_no_recording, setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
