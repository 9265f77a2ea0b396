/* SPDX-License-Identifier: MIT */
/* Random lines. None may crash the command set, get more than one reply or error, or leave settings that the head could
 * not run with. Seeds are fixed, so a failure names the line and comes again. */
#include "tests/common/thorough.h"
#include "tests/unit/command_device.h"

enum { SHARE = SANITIZED ? 10 : 1 };
enum { N_RANDOM = 200000 / SHARE, N_MUTATED = 300000 / SHARE, N_BYTES = 2000000 / SHARE };

static uint64_t rng;

/* xorshift64*, Vigna 2016. */
static uint32_t random_below(uint32_t n)
{
    rng ^= rng >> 12;
    rng ^= rng << 25;
    rng ^= rng >> 27;
    return (uint32_t)((rng * UINT64_C(2685821657736338717)) >> 32) % n;
}

static struct {
    unsigned ok, error, changes, effect[COMMAND_RELEASE + 1], overflowed;
} seen;

static void check_text(const char *line, const char *reply)
{
    if (strlen(reply) >= COMMAND_MAX_REPLY - 1) fail_msg("'%s': the reply is cut: %s", line, reply);
    for (const char *p = reply; *p != '\0'; p++)
        if (*p < 0x20 || *p > 0x7e) fail_msg("'%s': byte 0x%02x in the reply", line, (unsigned char)*p);
}

static void check_settings(const struct command_device *dev, const char *line)
{
    const struct head_settings *s = &dev->settings;
    const struct head_limits *l = &dev->limits;
    if (s->prr_uhz < l->prr_min_uhz || s->prr_uhz > l->prr_max_uhz || s->lines_uhz < l->lines_min_uhz ||
        s->lines_uhz > l->lines_max_uhz || s->lines_uhz > s->prr_uhz || s->pan_udeg_s < 0 ||
        s->pan_udeg_s > l->pan_max_udeg_s || s->line_start_udeg < l->fov_min_udeg ||
        s->line_stop_udeg > l->fov_max_udeg || s->line_start_udeg >= s->line_stop_udeg ||
        s->pan_start_udeg < l->pan_min_udeg || s->pan_stop_udeg > l->pan_max_udeg ||
        s->pan_start_udeg >= s->pan_stop_udeg || s->pan_stop_udeg - s->pan_start_udeg > 360 * MICRO || s->station < 1 ||
        s->station > l->n_stations || s->range_min_nm < l->range_min_nm || s->range_min_nm > l->near_most_nm ||
        s->range_max_nm < l->far_least_nm || s->range_max_nm > l->range_max_nm || s->range_min_nm >= s->range_max_nm ||
        s->noise > l->noise_most || s->angle_noise > l->angle_most || s->waves > l->waves_most ||
        s->sigma_nm < l->sigma_min_nm || s->sigma_nm > 10 * NANO || s->ball_nm < 0 || s->ball_nm > l->ball_max_nm)
        fail_msg("'%s' leaves settings out of range", line);
}

static int is_blank_line(const char *line)
{
    return line[strspn(line, " \t")] == '\0';
}

static void one(struct command_device *dev, const char *line)
{
    static struct command_result out;
    const struct head_settings before = dev->settings;
    const uint32_t queued = dev->queue.count, lost = dev->queue.overflow, session = random_below(4);
    memset(&out, 0x5a, sizeof out);
    command_execute(dev, session, line, &out);
    check_text(line, out.reply);
    check_settings(dev, line);
    const int is_error = strncmp(out.reply, "ERR ", 4) == 0;
    if (is_error != (out.error != 0)) fail_msg("'%s': error %d, reply %s", line, out.error, out.reply);
    if ((out.reply[0] == '\0') != is_blank_line(line)) fail_msg("'%s': reply '%s'", line, out.reply);
    if (is_error) {
        const int kept = dev->queue.count == queued + 1 && dev->queue.overflow == lost;
        const int dropped = queued == COMMAND_QUEUE_LEN && dev->queue.count == queued && dev->queue.overflow >= 2;
        if (kept == dropped) fail_msg("'%s': %u errors queued after %u", line, dev->queue.count, queued);
        if (memcmp(&before, &dev->settings, sizeof before) != 0) fail_msg("'%s': refused, but changed", line);
        if (out.effect != COMMAND_NONE || out.took_control || out.changes) fail_msg("'%s': refused with effect", line);
        seen.overflowed += (unsigned)dropped;
    } else if (dev->queue.count > queued) {
        fail_msg("'%s': no error, but one is queued", line);
    }
    seen.ok += is_error ? 0 : 1;
    seen.error += is_error ? 1 : 0;
    seen.changes += (unsigned)out.changes;
    seen.effect[out.effect]++;
    if (random_below(16) == 0) dev->control = random_below(3);
    if (random_below(16) == 0) dev->state = (enum head_state)random_below(HEAD_N_STATES);
}

static void begin(struct command_device *dev, uint64_t seed)
{
    *dev = command_test_device();
    dev->step_allowed = dev->keeps = dev->asks_server = 1;
    memset(&seen, 0, sizeof seen);
    rng = seed;
}

static void random_lines(void **ctx)
{
    (void)ctx;
    /* Half of the lines have any bytes. The others have only bytes of commands, and get further. */
    static const char alphabet[] = "*:;?,. +-0123456789eEHADPRLINSTOCMZKGXU\t\"'#[]";
    static struct command_device dev;
    begin(&dev, UINT64_C(0x9e3779b97f4a7c15));
    char line[COMMAND_MAX_LINE + 40];
    for (int i = 0; i < N_RANDOM; i++) {
        const uint32_t len = random_below(random_below(8) == 0 ? sizeof line - 1 : 24);
        for (uint32_t k = 0; k < len; k++)
            line[k] = (char)(i % 2 ? 1 + random_below(255) : (uint32_t)alphabet[random_below(sizeof alphabet - 1)]);
        line[len] = '\0';
        one(&dev, line);
    }
    assert_int_equal(seen.ok + seen.error, N_RANDOM);
    assert_true(seen.error > N_RANDOM / 2 && seen.overflowed > 0);
}

static const char *const valid[] = {
    "*IDN?",
    "*RST",
    "*CLS",
    "*OPC?",
    "*STB?",
    "SYST:ERR?",
    "SYSTEM:ERROR:NEXT?",
    "SYST:ERR:COUN?",
    "SYST:VERS?",
    "SYST:CONT?",
    "SYST:CONT:TAKE",
    "SYST:CONT:REL",
    "SYST:SESS?",
    "HEAD:PRR 300000",
    "HEAD:PRR 1.2 MHZ",
    "HEAD:PRR? MAX",
    "HEAD:LIN 100.5",
    "HEAD:LINES MIN",
    "HEAD:PAN 18 DEG/S",
    "HEAD:STAT?",
    "HEAD:REBOOT",
    "HEAD:STORE",
    "HEAD:STATION 2",
    "HEAD:RANG:MIN 1.5",
    "HEAD:RANG:MIN MAX",
    "HEAD:RANG:MAX 0.1 KM",
    "HEAD:NOIS ON",
    "HEAD:NOIS:ANGL ON",
    "HEAD:NOIS:SIGM 3 MM",
    "HEAD:NOIS:BALL 0.25 M",
    "SCAN:STEP 0.04",
    "SCAN:STEP? MAX",
    "SCAN:STEP:LINE 0.1 DEG",
    "SCAN:STEP:PAN DEF",
    "SCAN:STEP DEF",
    "HELP? HEAD:RANG:MAX",
    "HELP? SCAN:STEP",
    "HELP:SET?",
    "SITE:POSE 1, 2, 3, 4, 5, 6, 7",
    "SITE:POSE 2, DEF",
    "SITE:POSE? 1",
    "SCAN:LINE:STAR -12.5DEG",
    "SCAN:LINE:STOP 3.5e1",
    "SCAN:PAN:START -90",
    "SCAN:PAN:STOP 270",
    "SCAN:PAN:STOP DEF",
    "SCAN:FRAM 5",
    "SCAN:START",
    "SCAN:STOP",
    "SCAN:COUNT?",
    "SCAN:REPL 2.5,2,ON",
    "SCAN:REPL ,0",
    "SCAN:REPL?",
    "HELP?",
    "TIME?",
    "TIME:STEP 1000000",
    "TIME:STEP 1 S",
    "TIME:SHIF -5 S",
    "TIME:SERV CLIENT,127.0.0.1,600,-12,ETH",
    "TIME:SERV? STAT",
    "FAUL:ADD {kind: drop}",
    "FAUL:CLE 1",
    "FAUL:INJ? 2",
    "FAUL:LIST?",
};

/* Writes the line as its first `at` bytes, middle and end, as much as fits. */
static void compose(char *line, size_t size, size_t at, const char *middle, const char *end)
{
    const char *const parts[] = {middle, end};
    char rest[2 * (COMMAND_MAX_LINE + 40)];
    size_t len = 0;
    for (int i = 0; i < 2; i++)
        for (const char *p = parts[i]; *p != '\0' && len < sizeof rest; p++)
            rest[len++] = *p;
    if (len > size - at - 1) len = size - at - 1;
    memcpy(line + at, rest, len);
    line[at + len] = '\0';
}

static void mutate(char *line, size_t size)
{
    const size_t len = strlen(line), at = random_below((uint32_t)len + 1);
    const char byte[2] = {(char)(random_below(4) == 0 ? 1 + random_below(255) : 32 + random_below(95)), '\0'};
    const char *const rest = line + at;
    switch (random_below(5)) {
    case 0:
        compose(line, size, at, byte, rest); /* put in */
        break;
    case 1:
        compose(line, size, at, "", at < len ? rest + 1 : ""); /* take out */
        break;
    case 2:
        compose(line, size, at, byte, at < len ? rest + 1 : ""); /* change */
        break;
    case 3:
        compose(line, size, at, rest, rest); /* double a part */
        break;
    default:
        compose(line, size, at, valid[random_below(sizeof valid / sizeof valid[0])], ""); /* join two commands */
        break;
    }
}

static void mutated_commands(void **ctx)
{
    (void)ctx;
    static struct command_device dev;
    begin(&dev, UINT64_C(0xd1b54a32d192ed03));
    char line[COMMAND_MAX_LINE + 40];
    for (int i = 0; i < N_MUTATED; i++) {
        snprintf(line, sizeof line, "%s", valid[random_below(sizeof valid / sizeof valid[0])]);
        for (uint32_t n = random_below(5); n > 0; n--)
            mutate(line, sizeof line);
        one(&dev, line);
    }
    /* The random lines reached much: every effect occurred, and both answers often. */
    for (int effect = 0; effect <= COMMAND_RELEASE; effect++)
        assert_true(seen.effect[effect] > N_MUTATED / 10000); /* 1 line in 64 fits, 1 state in 7, 1 session in 3 */
    assert_true(seen.ok > N_MUTATED / 10 && seen.error > N_MUTATED / 10 && seen.changes > 1000 / SHARE);
}

/* Random bytes go through the collector. Each line that it gives goes to command_execute. */
static void random_bytes_through_the_collector(void **ctx)
{
    (void)ctx;
    static struct command_device dev;
    static struct command_lines lines;
    begin(&dev, UINT64_C(0x2545f4914f6cdd1d));
    unsigned ready = 0, overrun = 0;
    for (int i = 0; i < N_BYTES; i++) {
        /* A CR or LF comes by chance every 128 bytes, so lines are short. The second half has them twelve times as
         * rarely. */
        unsigned char byte = (unsigned char)random_below(256);
        if (i >= N_BYTES / 2 && (byte == '\n' || byte == '\r') && random_below(12) != 0) byte = 0;
        const enum command_line_kind kind = command_lines_feed(&lines, byte);
        ready += kind == COMMAND_LINE_READY;
        overrun += kind == COMMAND_LINE_OVERRUN;
        if (kind != COMMAND_LINE_READY) continue;
        assert_true(strlen(lines.buf) <= COMMAND_MAX_LINE);
        check_text("collector", lines.buf);
        one(&dev, lines.buf);
    }
    assert_true(ready > 1000 / SHARE && overrun > 100 / SHARE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_lines),
        cmocka_unit_test(mutated_commands),
        cmocka_unit_test(random_bytes_through_the_collector),
    };
    return cmocka_run_group_tests_name("command fuzz", tests, NULL, NULL);
}
