/* SPDX-License-Identifier: MIT */
/* This fuzzes sessions of the protocols that are other heads': nmea, scip, cola, velodyne with its position packets and
 * its pages. The input is a byte (which), a byte (how), then records: bytes from the client, points and events of a
 * head that spins, time, lost frames, or a client that reads nothing. No unit may be longer than the protocol says, and
 * commands to the head must be lines. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native_encode.h"
#include "tests/common/protocol_rig.h"
#include "tests/fuzz/rig.h"
#include "tests/unit/command_device.h"

enum { MAX_RECORDS = 200, MAX_BYTES = 600 };

static struct protocol_rig rig;
static struct command_device device;

static int send_unit(void *ctx, const void *unit, size_t len)
{
    (void)ctx, (void)unit;
    fuzz_must(len > 0 && len <= rig.ops->max_unit, "a unit within the protocol's limit");
    if (rig.room == 0) return 1;
    return 0;
}

/* Answers as the head does, by the command set itself. */
static int run_command(void *ctx, const char *line, char *reply, size_t cap)
{
    struct command_result out;
    (void)ctx;
    fuzz_must((reply == NULL || cap >= COMMAND_MAX_REPLY) && strlen(line) <= COMMAND_MAX_LINE,
              "a command is a line, with room for a reply if there is any");
    command_execute(&device, 1, line, &out);
    if (out.effect == COMMAND_START) device.state = HEAD_SCANNING;
    if (out.effect == COMMAND_STOP || out.effect == COMMAND_RESET) device.state = HEAD_IDLE;
    device.control = 0;
    if (reply != NULL) snprintf(reply, cap, "%s", out.reply);
    return out.error;
}

static int64_t date_ns(void *ctx, int64_t t_ns)
{
    (void)ctx;
    return t_ns + device.shift_ns;
}

static int fix(void *ctx, int64_t t_ns, struct nmea_fix *out)
{
    (void)ctx, (void)t_ns;
    *out = rig.fix;
    return rig.fix.quality != 0;
}

static void count(void *ctx, enum protocol_count what, uint64_t n)
{
    (void)ctx;
    fuzz_must(what < PROTOCOL_N_COUNTS, "a count that there is");
    rig.count[what] += n;
}

static void hang_up(void *ctx)
{
    (void)ctx;
    rig.hung_up = 1;
}

static int64_t next_fix_ns(void *ctx, int64_t t_ns)
{
    (void)ctx;
    return (t_ns + 999999999) / 1000000000 * 1000000000;
}

static enum protocol_pps pps(void *ctx, int64_t t_ns, int64_t *hour_ns)
{
    (void)ctx;
    const int has_utc = rig.utc0_ns != INT64_MIN;
    *hour_ns = ((has_utc ? rig.utc0_ns : 0) + t_ns) % INT64_C(3600000000000);
    return has_utc ? PROTOCOL_PPS_LOCKED : PROTOCOL_PPS_ABSENT;
}

/* Opens a session without clearing the rig's megabytes. */
static void open_session(enum protocol_id id, unsigned how)
{
    static const char *const models[] = {"UTM-30LX-EW", "UST-20LX", "URG-04LX", "TiM571",
                                         "LMS111",      "TiM561",   "VLP-16",   "TiM781"};
    struct sh_err err = {0};
    device = command_test_device();
    rig.ops = protocol_ops_get(id);
    rig.room = SIZE_MAX;
    rig.seq = 0;
    rig.hung_up = 0;
    rig.scan_t0_ns = 0;
    rig.attributes = how >> 3 & 1;
    rig.utc0_ns = how & 16 ? INT64_C(1767225600000000000) : INT64_MIN;
    rig.fix = (struct nmea_fix){.quality = how >> 5 & 1};
    memset(&rig.identity, 0, sizeof rig.identity);
    snprintf(rig.identity.maker, sizeof rig.identity.maker, "Maker");
    snprintf(rig.identity.model, sizeof rig.identity.model, "%s", models[how & 7]);
    snprintf(rig.identity.serial, sizeof rig.identity.serial, "17210001");
    snprintf(rig.identity.firmware, sizeof rig.identity.firmware, "1.2.3");
    snprintf(rig.identity.name, sizeof rig.identity.name, "rig");
    rig.spec =
        (struct protocol_spec){.identity = &rig.identity,
                               .host = {&rig, send_unit, run_command, fix, count, hang_up, next_fix_ns, pps, date_ns},
                               .near_wrap = how & 64 ? 3 : 0,
                               .waits = how >> 7 & 1,
                               .address = "127.0.0.1",
                               .port = 2368};
    rig.protocol = NULL;
    if (protocol_create(rig.ops, &rig.spec, &rig.protocol, &err) != SH_OK) {
        fuzz_must_be_line(&err);
        rig.protocol = NULL;
        return;
    }
    if (id == PROTOCOL_VELODYNE || id == PROTOCOL_VELODYNE_POSITION || id == PROTOCOL_VELODYNE_HTTP)
        protocol_rig_beams(&rig, 10);
    else
        protocol_rig_planar(&rig, 1440, 0, 1080, 540, -1, 40);
    if (rig.ops->open != NULL) rig.ops->open(rig.protocol, 0);
}

/* Gives an event of the head: scans begin and end, settings change, pulses are lost. */
static void give_event(unsigned how, int64_t t_ns)
{
    uint8_t frame[256];
    const struct native_event event = {.code = 1 + how % 12, .a = how >> 4, .b = (uint64_t)t_ns, .c = how & 3};
    const size_t len = native_encode_event(frame, sizeof frame, &event, t_ns, 0);
    native_finish_frame(frame, rig.seq++);
    if (event.code == NATIVE_EV_SCAN_START) rig.scan_t0_ns = t_ns;
    if (rig.ops->frame != NULL) rig.ops->frame(rig.protocol, frame, len);
}

/* Gives points for a part of a turn, with echoes as the byte says. */
static void give_points(unsigned how, uint32_t *line)
{
    enum { N = 96 };
    static double mirror[N], pan[N];
    static int64_t dt_ns[N];
    static struct protocol_rig_shot shot[N];
    for (uint32_t i = 0; i < N; i++) {
        pan[i] = (double)i / 1440.0;
        dt_ns[i] = i * 17361;
        shot[i] = (struct protocol_rig_shot){.n = (i + how) % 4,
                                             .range_m = {0.05 + how * 0.3, 2.0 + i, 200.0},
                                             .refl_cdb = {-3000, 0, 2000},
                                             .amplitude_cdb = {0, 3000, 32767}};
    }
    const struct protocol_rig_run run = {.frame = *line,
                                         .line = *line,
                                         .pulse0 = *line * 1440u,
                                         .n = 1 + how % N,
                                         .t0_ns = *line * 25000000LL,
                                         .line_t0_ns = *line * 25000000LL,
                                         .dt_ns = dt_ns,
                                         .mirror_turn = mirror,
                                         .pan_turn = pan,
                                         .shot = shot};
    if (rig.ops->frame == NULL) return;
    protocol_rig_points(&rig, &run);
    if ((how & 128) == 0) return;
    const struct line_end end = {.frame = *line,
                                 .line = *line,
                                 .pulse0 = *line * 1440u,
                                 .n_fired = 1440,
                                 .n_cast = 1081,
                                 .t0_ns = *line * 25000000LL,
                                 .t1_ns = (*line + 1) * 25000000LL,
                                 .status = LINE_LAST_OF_FRAME};
    protocol_rig_line_end(&rig, &end);
    ++*line;
}

static void act(struct fuzz_bytes *in, int64_t *t_ns, uint32_t *line)
{
    const unsigned what = fuzz_u8(in);
    const size_t len = fuzz_u8(in) + ((what >> 4 & 1) << 8);
    size_t n;
    switch (what & 7) {
    case 0:
    case 1:
    case 2: {
        const uint8_t *bytes = fuzz_take(in, len, &n);
        if (n > 0) rig.ops->input(rig.protocol, bytes, n);
        break;
    }
    case 3:
        give_event((unsigned)len & 255, *t_ns);
        break;
    case 4:
        give_points((unsigned)len & 255, line);
        break;
    case 5:
        *t_ns += (int64_t)len * ((what & 128) != 0 ? 50000000 : 1000000);
        if (rig.ops->time != NULL) rig.ops->time(rig.protocol, *t_ns);
        if (rig.ops->next_ns != NULL) rig.ops->next_ns(rig.protocol);
        break;
    case 6:
        if (rig.ops->gap != NULL) rig.ops->gap(rig.protocol, 1 + (uint32_t)len);
        break;
    default:
        rig.room = (what & 8) != 0 ? 0 : SIZE_MAX;
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes in = {data, size};
    const unsigned which = fuzz_u8(&in), how = fuzz_u8(&in);
    int64_t t_ns = 0;
    uint32_t line = 0;
    if (size > 8192) return 0;
    open_session((enum protocol_id)(PROTOCOL_NMEA + which % (PROTOCOL_CAPTURE - PROTOCOL_NMEA)), how);
    if (rig.protocol == NULL) return 0;
    if ((which & 128) == 0 && rig.ops->frame != NULL) protocol_rig_describe(&rig, 0);
    for (int i = 0; i < MAX_RECORDS && in.n > 0 && !rig.hung_up; i++)
        act(&in, &t_ns, &line);
    protocol_destroy(rig.ops, rig.protocol);
    return 0;
}
