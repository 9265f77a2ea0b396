/* SCIP, the sensor's side: scans. Bytes by hand from the protocol's description, and a decoder written from
 * it. */
#include "tests/unit/scip_rig.h"

static struct scip_decoded got;

/* Five steps, 0 to 4, and a scan of them with all kinds of value: 1234 mm, 5432 mm, no echo, too near, 30000
 * mm. The description encodes 1234 as CB in two characters, 5432 as 1Dh in three and 16000000 as m2@0 in
 * four. 30000 is 7 * 4096 + 20 * 64 + 48. */
static void open_five(const char *model)
{
    scip_open_head(model, 360, 0, 4, 2, -1, 10);
    protocol_rig_describe(&rig, 0);
    rig.scan_t0_ns = 16000000 * 1000000LL;
    rig.ops->time(rig.protocol, rig.scan_t0_ns);
    shot[0] = (struct protocol_rig_shot){.n = 1, .range_m = {1.234}};
    shot[1] = (struct protocol_rig_shot){.n = 1, .range_m = {5.432}};
    shot[2] = (struct protocol_rig_shot){.n = 0};
    shot[3] = (struct protocol_rig_shot){.n = 1, .range_m = {0.05}};
    shot[4] = (struct protocol_rig_shot){.n = 1, .range_m = {30.0}};
}

static void bytes_by_hand(void **state)
{
    (void)state;
    open_five("UTM-30LX");
    scip_ask("MD0000000401002;tag\n", "MD0000000401002;tag\n00P\n\n");
    scip_turn(0);
    scip_expect("MD0000000401001;tag\n99b\nm2@0?\n0CB1Dh0010047D`B\n\n");
    scip_ask("MS0000000400001\n", "MS0000000400001\n00P\n\n");
    scip_turn(1); /* 100 ms later: 16000100 is 61, 2, 17, 36 */
    scip_expect("MS0000000400000\n99b\nm2ATd\nCBoo0104oo6\n\n");
    scip_ask("BM\nGD0001000101;1\n", "BM\n00P\n\n");
    scip_turn(2); /* 16000200: 61, 2, 19, 8 */
    scip_expect("GD0001000101;1\n00P\nm2C8J\n1DhM\n\n");
    scip_close();
}

/* Ranges of 0.1 to 30 m in steps of 1 um, which the description rounds to mm. */
static uint32_t random_um(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return 100000 + *seed % 29900000;
}

static void ranges_to_the_millimetre(void **state)
{
    (void)state;
    static uint32_t um[3][1081];
    uint32_t seed = 1;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000003\n", "MD0000108000003\n00P\n\n");
    for (uint32_t k = 0; k < 3; k++) {
        static const char *const echo[] = {"MD0000108000002", "MD0000108000001", "MD0000108000000"};
        for (int i = 0; i < 1081; i++)
            shot[i].range_m[0] = (um[k][i] = random_um(&seed)) * 1e-6;
        scip_turn(k);
        scip_decode_only(&got, 3, 0);
        assert_string_equal(got.echo, echo[k]);
        assert_string_equal(got.status, "99");
        assert_int_equal(got.time_ms, 25 * k);
        assert_int_equal(got.n_steps, 1081);
        for (int i = 0; i < 1081; i++)
            assert_int_equal(got.range_mm[i][0], (um[k][i] + 500) / 1000);
    }
    scip_turn(3);
    scip_expect("");
    scip_ask("GD0000108001\n", "GD0000108001\n10Q\n\n"); /* the laser went off after the last */
    scip_close();
}

/* Without end the two digits stay 00, and a scan is as long as the description makes it: 6717 bytes of 1081
 * steps with intensity, in lines of 64 characters and a sum. */
static void without_end(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("ME0000108001000\n", "ME0000108001000\n00P\n\n");
    for (uint32_t k = 0; k < 120; k++) {
        scip_turn(k);
        assert_int_equal(rig.n_units, 1);
        assert_int_equal(rig.len, 6717);
        assert_memory_equal(rig.bytes, "ME0000108001000\n99b\n", 20);
        scip_decode_only(&got, 3, 1);
        assert_int_equal(got.time_ms, 25 * k);
    }
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 0);
    scip_close();
}

/* Steps count counter-clockwise seen from above: what stands to the left, 90 degrees from the front, is a
 * quarter of a turn above the front step. The rig places a shot by its pan, which is clockwise from the
 * front. */
static void left_is_left(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_flat(5.0);
    shot[540 + 360].range_m[0] = 2.0; /* pan - (900 - 540) / 1440 of a turn: left */
    scip_ask("MD0000108000001\n", "MD0000108000001\n00P\n\n");
    scip_turn(0);
    scip_decode_only(&got, 3, 0);
    for (int i = 0; i < 1081; i++)
        assert_int_equal(got.range_mm[i][0], i == 540 + 1440 / 4 ? 2000 : 5000);
    scip_close();

    scip_open_head("UTM-30LX", 1440, 100, 1000, 500, 1, 40); /* a head that turns clockwise */
    protocol_rig_describe(&rig, 0);
    scip_flat(5.0);
    shot[500 - 360 - 100].range_m[0] = 2.0; /* pan (140 - 500) / 1440: left */
    protocol_rig_input(&rig, "PP\n");
    rig.bytes[rig.len] = 0;
    assert_non_null(strstr((char *)rig.bytes, "\nAMIN:100;"));
    assert_non_null(strstr((char *)rig.bytes, "\nAMAX:1000;"));
    assert_non_null(strstr((char *)rig.bytes, "\nAFRT:600;")); /* 400 steps to the left of it, 500 to the right */
    protocol_rig_clear(&rig);
    scip_ask("MD0100100000001\n", "MD0100100000001\n00P\n\n");
    scip_turn(0);
    scip_decode_only(&got, 3, 0);
    for (int i = 100; i <= 1000; i++)
        assert_int_equal(got.range_mm[i - 100][0], i == 600 + 1440 / 4 ? 2000 : 5000);
    scip_close();
}

/* The least range of a cluster, errors left out; an error where there is nothing else. */
static void clusters(void **state)
{
    (void)state;
    static const struct {
        const char *parameters, *data;
    } rows[] = {{"0000000402", "0CB0017D`Q"},
                {"0000000403", "0CB7D`@"},
                {"0000000499", "0CBe"},
                {"0001000302", "1Dh004a"},
                {"0000000400", "0CB1Dh0010047D`B"}};
    open_five("UTM-30LX");
    shot[0].range_m[0] = 1.234;
    scip_ask("BM\n", "BM\n00P\n\n");
    for (uint32_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char line[40], tail[60];
        snprintf(line, sizeof line, "GD%s\n", rows[i].parameters);
        snprintf(tail, sizeof tail, "\n%s\n\n", rows[i].data);
        scip_ask(line, "");
        scip_turn(i);
        rig.bytes[rig.len] = 0;
        assert_int_equal(rig.len, 22 + strlen(tail)); /* echo, status, time without its line end */
        assert_string_equal((char *)rig.bytes + 22, tail);
        protocol_rig_clear(&rig);
    }
    scip_close();
}

static void several_echoes(void)
{
    shot[0] = (struct protocol_rig_shot){.n = 3,
                                         .range_m = {1.234, 5.432, 30.0},
                                         .refl_cdb = {0, -2000, LINE_REFL_NONE},
                                         .amplitude_cdb = {0, 4000, LINE_AMPLITUDE_NONE}};
    shot[1] = (struct protocol_rig_shot){.n = 0};
}

/* 1000 is 15 * 64 + 40: a matt white surface. 20 dB below it is a tenth: 100, 64 + 36. An amplitude of 0 dB
 * is 100, of 40 dB a hundred times that: 10000, 2 * 4096 + 28 * 64 + 16. */
static void echoes_and_intensity(void **state)
{
    (void)state;
    static const struct {
        const char *command, *data;
        int attributes;
    } rows[] = {{"HD", "0CB&1Dh&7D`001:", 0},
                {"HE", "0CB0?X&1Dh01T&7D`000001000V", 0},
                {"HE", "0CB01T&1Dh2L@&7D`000001000M", 1},
                {"GD", "0CB0016", 0},
                {"GE", "0CB0?X001000M", 0},
                {"GE", "0CB01T001000;", 1}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char line[40], tail[60];
        open_five("UTM-30LX");
        several_echoes();
        rig.attributes = rows[i].attributes;
        protocol_rig_describe(&rig, 0);
        snprintf(line, sizeof line, "%s0000000101\n", rows[i].command);
        snprintf(tail, sizeof tail, "\n%s\n\n", rows[i].data);
        protocol_rig_input(&rig, "BM\n");
        protocol_rig_clear(&rig);
        scip_ask(line, "");
        scip_turn(0);
        rig.bytes[rig.len] = 0;
        assert_string_equal((char *)rig.bytes + 22, tail);
        scip_close();
    }
}

/* Marks may stand at the end of a line of 64 characters: all places come by in a scan of two echoes. */
static void marks_anywhere(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    for (int i = 0; i < 1081; i++)
        shot[i] = (struct protocol_rig_shot){.n = 1 + (uint32_t)(i % 3), .range_m = {1.0 + i * 1e-3, 10.0, 20.0}};
    scip_ask("ND0000108000001\n", "ND0000108000001\n00P\n\n");
    scip_turn(0);
    scip_decode_only(&got, 3, 0);
    assert_int_equal(got.n_steps, 1081);
    for (uint32_t i = 0; i < 1081; i++) {
        assert_int_equal(got.n[i], 1 + i % 3);
        assert_int_equal(got.range_mm[i][0], 1000 + i);
        assert_int_equal(got.range_mm[i][1], i % 3 >= 1 ? 10000 : 0);
        assert_int_equal(got.range_mm[i][2], i % 3 == 2 ? 20000 : 0);
    }
    scip_close();
}

/* What stands in a range's place. 44 is the URG-04LX's first step; 40 to 43 can't be measured. */
static void codes_of_a_urg(void **state)
{
    (void)state;
    scip_open("URG-04LX");
    shot[1] = (struct protocol_rig_shot){.n = 0};
    shot[2].range_m[0] = 0.019;
    scip_ask("MS0040004601001\n", "MS0040004601001\n00P\n\n");
    scip_turn(0);
    scip_decode_only(&got, 2, 0);
    static const uint32_t want[] = {19, 19, 19, 19, 1000, 0, 6};
    assert_int_equal(got.n_steps, 7);
    for (int i = 0; i < 7; i++)
        assert_int_equal(got.range_mm[i][0], want[i]);
    scip_close();
}

static void parameters(void **state)
{
    (void)state;
    static const struct {
        const char *line, *status;
    } rows[] = {{"MDx000108001000", "01Q"}, {"MD0000 08001000", "02R"}, {"MD00001080-1000", "03S"},
                {"MD000010800a000", "03S"}, {"MD0000108001a00", "06V"}, {"MD0000108001000", "00P"},
                {"MD000010800100x", "07W"}, {"MD0000108101000", "04T"}, {"MD0541054001000", "05U"},
                {"MD0540054001000", "00P"}, {"GDx000108001", "01Q"},    {"GD0000x08001", "02R"},
                {"GD00001080x1", "03S"},    {"GD0000108101", "04T"},    {"GD0541054001", "05U"}};
    scip_open("UTM-30LX");
    scip_ask("BM\n", "BM\n00P\n\n");
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char line[40], answer[40];
        snprintf(line, sizeof line, "%s\n", rows[i].line);
        snprintf(answer, sizeof answer, "%s\n%s\n\n", rows[i].line, rows[i].status);
        scip_ask(line, answer);
    }
    scip_close();
}

/* Which of ten turns come, by their time stamps. */
static void check_turns(const char *command, const char *want)
{
    char line[40], times[80] = "";
    scip_open("UTM-30LX");
    snprintf(line, sizeof line, "%s\n", command);
    protocol_rig_input(&rig, line);
    protocol_rig_clear(&rig);
    for (uint32_t k = 0; k < 10; k++) {
        scip_turn(k);
        if (rig.len == 0) continue;
        scip_decode_only(&got, 3, 0);
        snprintf(times + strlen(times), sizeof times - strlen(times), "%u:%.2s ", got.time_ms / 25, got.echo + 13);
    }
    assert_string_equal(times, want);
    scip_close();
}

static void skipped_scans(void **state)
{
    (void)state;
    check_turns("MD0000108000003", "0:02 1:01 2:00 ");
    check_turns("MD0000108000103", "1:02 3:01 5:00 ");
    check_turns("MD0000108000302", "3:01 7:00 ");
    check_turns("MD0000108000400", "4:00 9:00 ");
    check_turns("MD0000108000999", "9:98 ");
}

/* A turn that is left out may as well be broken. */
/* Somebody stops the head, and a client asks for scans while the last ones still come. */
static void asked_while_it_stops(void **state)
{
    (void)state;
    static const struct protocol_rig_reply stops[] = {{"HEAD:STATE?", "spin-down", 0}, {NULL, NULL, 0}},
                                           idle[] = {{"HEAD:STATE?", "idle", 0}, {NULL, NULL, 0}};
    scip_open("UTM-30LX");
    scip_turn(0);
    scip_ask("MD0000108001000\n", "MD0000108001000\n00P\n\n");
    assert_int_equal(rig.n_lines, 0);
    rig.replies = stops;
    rig.ops->time(rig.protocol, 900000000);
    rig.replies = idle;
    rig.ops->time(rig.protocol, 950000000);
    assert_int_equal(rig.n_lines, 1); /* ten times a second at most */
    rig.ops->time(rig.protocol, 1000000000);
    assert_int_equal(rig.n_lines, 3);
    assert_string_equal(rig.line[2], "SCAN:START");
    /* The first scan has come: who stops the head now means it. */
    scip_turn(41);
    assert_true(rig.len > 3000);
    protocol_rig_clear(&rig);
    rig.ops->time(rig.protocol, 9000000000);
    assert_int_equal(rig.n_lines, 0);
    scip_close();
}

static void skipped_and_broken(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000100\n", "MD0000108000100\n00P\n\n");
    scip_part(0, 0, 500);
    scip_line_end(0, 0);
    scip_line_time(0);
    scip_turn(1);
    scip_decode_only(&got, 3, 0);
    assert_int_equal(got.time_ms, 25);
    scip_close();
}

/* A scan goes out once its last step has come, before the turn is over. */
static void sent_after_the_last_step(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    scip_part(0, 0, 700);
    scip_part(0, 701, 1079);
    scip_expect("");
    scip_part(0, 1080, 1080);
    scip_decode_only(&got, 3, 0);
    scip_line_end(0, 0);
    scip_line_time(0);
    scip_expect("");
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 0);
    scip_close();
}

/* QT ends a stream within a turn; a second M takes the first one's place, a refused one doesn't. */
static void streams_end(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    scip_part(0, 0, 700);
    scip_ask("QT\n", "QT\n00P\n\n");
    scip_part(0, 701, 1080);
    scip_line_end(0, 0);
    scip_line_time(0);
    scip_turn(1);
    scip_expect("");
    scip_ask("MD0000108000000\nMD0000000301002\n", "MD0000108000000\n00P\n\nMD0000000301002\n00P\n\n");
    scip_turn(2);
    scip_decode_only(&got, 3, 0);
    assert_string_equal(got.echo, "MD0000000301001");
    assert_int_equal(got.n_steps, 4);
    scip_ask("MD0003000001002\n", "MD0003000001002\n05U\n\n");
    scip_turn(3);
    scip_decode_only(&got, 3, 0);
    assert_string_equal(got.echo, "MD0000000301000");
    scip_close();
}

/* M gives what was measured after it was asked for, G the next scan that is whole and was measured with the
 * laser on. */
static void measured_when(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_part(0, 0, 700);
    rig.ops->time(rig.protocol, 12000000);
    scip_ask("BM\nMD0000108000000\nGD0000000001\n", "BM\n00P\n\nMD0000108000000\n00P\n\n");
    scip_part(0, 701, 1080);
    scip_line_end(0, 0);
    scip_line_time(0);
    scip_expect("");
    scip_turn(1);
    const char *at = (const char *)rig.bytes;
    scip_decode(&got, &at, 3, 0);
    assert_string_equal(got.echo, "GD0000000001");
    assert_string_equal(got.status, "00");
    assert_int_equal(got.time_ms, 25);
    scip_decode(&got, &at, 3, 0);
    assert_string_equal(got.echo, "MD0000108000000");
    assert_int_equal(got.time_ms, 25);
    protocol_rig_clear(&rig);
    scip_part(2, 0, 700);
    rig.ops->time(rig.protocol, 62000000);
    scip_ask("QT\nBM\nQT\n", "QT\n00P\n\nBM\n00P\n\nQT\n00P\n\n");
    scip_close();
}

static void handshakes(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("BM\n", "BM\n00P\n\n");
    for (uint32_t k = 0; k < 5; k++) {
        scip_ask("GD0000108001\n", "");
        scip_turn(k);
        scip_decode_only(&got, 3, 0);
        assert_string_equal(got.status, "00");
        assert_int_equal(got.time_ms, 25 * k);
    }
    scip_ask("GD0000108001;a\nGD0000108001;b\n", "GD0000108001;b\n0Bb\n\n");
    scip_ask("QT\n", "GD0000108001;a\n10Q\n\nQT\n00P\n\n");
    scip_ask("BM\nGD0000108001;c\n", "BM\n00P\n\n");
    rig.ops->time(rig.protocol, 125000000 + 1999999999);
    scip_expect("");
    rig.ops->time(rig.protocol, 125000000 + 2000000000); /* no scan has come */
    scip_expect("GD0000108001;c\n0Aa\n\n");
    rig.ops->time(rig.protocol, 125000000 + 5000000000);
    scip_expect("");
    scip_close();
}

/* A turn with missing frames is not sent and counted; those that were asked for all come. */
static void lost_frames(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000003\n", "MD0000108000003\n00P\n\n");
    scip_part(0, 0, 500);
    rig.ops->gap(rig.protocol, 1);
    scip_part(0, 502, 1080);
    scip_line_end(0, 0);
    scip_line_time(0);
    scip_expect("");
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 1);
    scip_turn(1);
    scip_decode_only(&got, 3, 0);
    assert_string_equal(got.echo + 13, "02");
    scip_part(2, 0, 900);
    rig.ops->gap(rig.protocol, 20); /* the rest of turn 2, turns 3 and 4, the begin of turn 5 */
    scip_part(5, 100, 1080);
    scip_line_end(5, 0);
    scip_expect("");
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 5);
    rig.ops->gap(rig.protocol, 1); /* all points of turn 6 */
    scip_line_end(6, 0);
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 6);
    scip_turn(7);
    scip_decode_only(&got, 3, 0);
    assert_string_equal(got.echo + 13, "01");
    assert_int_equal(got.time_ms, 175);
    scip_close();
}

/* Points whose attributes are missing have no intensity. The rig's frames alternate: points, attributes. */
static void (*real_frame)(void *, const uint8_t *, size_t);
static int n_attributes;
static void leave_out_one(void *protocol, const uint8_t *frame, size_t len)
{
    if (frame[1] == NATIVE_ATTRIBUTES && n_attributes++ == 3) return;
    real_frame(protocol, frame, len);
}

static void lost_attributes(void **state)
{
    (void)state;
    struct protocol_ops ops;
    scip_open("UTM-30LX");
    rig.attributes = 1;
    protocol_rig_describe(&rig, 0);
    scip_ask("ME0000108000000\n", "ME0000108000000\n00P\n\n");
    ops = *rig.ops;
    real_frame = ops.frame;
    ops.frame = leave_out_one;
    rig.ops = &ops;
    n_attributes = 0;
    scip_turn(0);
    scip_expect("");
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 1);
    scip_turn(1);
    scip_decode_only(&got, 3, 1);
    assert_int_equal(got.time_ms, 25);
    n_attributes = 3 - 10; /* the last of the turn's eleven frames */
    scip_turn(2);
    scip_expect("");
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 2);
    scip_close();
}

/* What never was, is not lost: the turn within which the scan was stopped, or the client joined. */
static void turns_that_are_not_lost(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    scip_part(0, 300, 1080);
    scip_line_end(0, 0);
    scip_turn(1);
    scip_part(2, 0, 600);
    scip_line_end(2, LINE_PARTIAL);
    rig.descriptor.scan = 2;
    rig.scan_t0_ns = 10000000000;
    protocol_rig_describe(&rig, rig.scan_t0_ns);
    protocol_rig_clear(&rig);
    scip_turn(0);
    scip_decode_only(&got, 3, 0);
    assert_int_equal(got.time_ms, 10000);
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 0);
    scip_close();
}

/* Parts of two turns never make one: of two scans, each with a turn of that number, or the same part sent
 * over again. */
static void turns_are_not_mixed(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_turn(0);
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    scip_turn(1);
    protocol_rig_clear(&rig);
    scip_part(2, 0, 600);
    rig.ops->gap(rig.protocol, 1000); /* the rest of this scan, and the begin of the next one */
    rig.scan_t0_ns = 10000000000;
    scip_part(2, 601, 1080);
    scip_line_end(2, 0);
    scip_expect("");
    scip_part(3, 0, 539);
    scip_part(3, 0, 539);
    scip_part(3, 0, 0);
    scip_line_end(3, 0);
    scip_expect("");
    scip_turn(4);
    scip_decode_only(&got, 3, 0);
    assert_int_equal(got.time_ms, 10100);
    scip_close();
}

/* A change of speed within a turn sends descriptor and emitter again, and takes nothing from the turn;
 * another number of steps begins anew. */
static void speed_changes_within_a_turn(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    scip_part(0, 0, 600);
    rig.descriptor.lines_uhz = 39000000;
    rig.emitter.sequence_ns_den = 39 * 1440;
    protocol_rig_describe(&rig, 10000000);
    rig.descriptor.lines_uhz = 40000000;
    scip_part(0, 601, 1080);
    scip_decode_only(&got, 3, 0);
    assert_int_equal(got.n_steps, 1081);
    scip_part(1, 0, 600);
    rig.emitter.last_step = 600;
    protocol_rig_describe(&rig, 40000000);
    scip_part(1, 601, 601);
    scip_line_end(1, 0);
    scip_expect("");
    scip_ask("MD0000060100000\n", "MD0000060100000\n04T\n\n");
    scip_close();
}

/* 2^24 ms are 4 h 39 min 37.216 s. The stamp is that of step 0, wherever the scan begins. */
static void the_clock_wraps(void **state)
{
    (void)state;
    scip_open("URG-04LX");
    rig.scan_t0_ns = 16777216000000 - 150000000;
    scip_ask("MD0044072500000\n", "MD0044072500000\n00P\n\n");
    static const uint32_t want_ms[] = {16777066, 16777166, 50, 150};
    for (uint32_t k = 0; k < 4; k++) {
        scip_turn(k);
        scip_decode_only(&got, 3, 0);
        assert_int_equal(got.time_ms, want_ms[k]);
    }
    protocol_rig_input(&rig, "RS\nMD0044072500000\n");
    protocol_rig_clear(&rig);
    scip_turn(4);
    scip_turn(5);
    const char *at = (const char *)rig.bytes;
    scip_decode(&got, &at, 3, 0);
    assert_int_equal(got.time_ms, 0);
    scip_decode(&got, &at, 3, 0);
    assert_int_equal(got.time_ms, 100);
    scip_close();
}

/* All that came since, a line each: the two digits of an echo and its status, or only the status. */
static void check_played(const char *want)
{
    char text[512] = "";
    rig.bytes[rig.len] = 0;
    for (uint32_t i = 0; i < rig.n_units; i++) {
        const char *unit = (const char *)rig.bytes + (i == 0 ? 0 : rig.end[i - 1]);
        snprintf(text + strlen(text), sizeof text - strlen(text), "%.2s:%.2s ", unit + 13, unit + 16);
    }
    assert_string_equal(text, want);
    protocol_rig_clear(&rig);
}

static void turns_of_a_stream(uint32_t *line, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        scip_turn((*line)++);
}

static void played_malfunctions(void **state)
{
    (void)state;
    uint32_t line = 0;
    scip_open("UTM-30LX");
    scip_ask("DB10\nDB06\nDB0x\nDB01\n", "DB10\n03S\n\nDB06\n01Q\n\nDB0x\n01Q\n\nDB01\n04T\n\n");
    scip_ask("MD0000108000000\nDB02\n", "MD0000108000000\n00P\n\nMD0000108000000\n50U\n\nDB02\n00P\n\n");
    scip_ask("DB02\nDB03\nBM\nMD0000108000000\n", "DB02\n02R\n\nDB03\n05U\n\nBM\n01Q\n\nMD0000108000000\n50U\n\n");
    turns_of_a_stream(&line, 1);
    scip_expect("");
    scip_ask("DB10\nBM\nQT\n", "DB10\n00P\n\nBM\n00P\n\nQT\n00P\n\n");

    scip_ask("DB03\nMD0000108000030\n", "DB03\n00P\n\nMD0000108000030\n00P\n\n");
    turns_of_a_stream(&line, 21);
    check_played("29:99 28:99 27:99 26:99 25:99 24:99 23:99 22:99 21:99 20:99 20:21 20:98 ");
    scip_turn(line++);
    check_played("19:99 ");
    scip_ask("QT\nDB04\nMD0000108000020\n", "QT\n00P\n\nDB04\n00P\n\nMD0000108000020\n00P\n\n");
    turns_of_a_stream(&line, 20); /* too short for it */
    assert_int_equal(rig.n_units, 20);
    protocol_rig_clear(&rig);
    scip_ask("MD0000108000021\n", "MD0000108000021\n00P\n\n");
    turns_of_a_stream(&line, 25);
    check_played("20:99 19:99 18:99 17:99 16:99 15:99 14:99 13:99 12:99 11:99 11:21 11:50 ");
    scip_ask("BM\nDB10\nDB05\n", "BM\n01Q\n\nDB10\n00P\n\nDB05\n00P\n\n");
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    turns_of_a_stream(&line, 25);
    check_played("00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:50 ");
    scip_ask("RS\nBM\n", "RS\n00P\n\nBM\n00P\n\n");
    scip_close();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bytes_by_hand),
        cmocka_unit_test(ranges_to_the_millimetre),
        cmocka_unit_test(without_end),
        cmocka_unit_test(left_is_left),
        cmocka_unit_test(clusters),
        cmocka_unit_test(echoes_and_intensity),
        cmocka_unit_test(marks_anywhere),
        cmocka_unit_test(codes_of_a_urg),
        cmocka_unit_test(parameters),
        cmocka_unit_test(skipped_scans),
        cmocka_unit_test(streams_end),
        cmocka_unit_test(sent_after_the_last_step),
        cmocka_unit_test(measured_when),
        cmocka_unit_test(handshakes),
        cmocka_unit_test(lost_frames),
        cmocka_unit_test(lost_attributes),
        cmocka_unit_test(the_clock_wraps),
        cmocka_unit_test(turns_that_are_not_lost),
        cmocka_unit_test(turns_are_not_mixed),
        cmocka_unit_test(speed_changes_within_a_turn),
        cmocka_unit_test(asked_while_it_stops),
        cmocka_unit_test(skipped_and_broken),
        cmocka_unit_test(played_malfunctions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
