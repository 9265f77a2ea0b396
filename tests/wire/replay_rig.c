/* SPDX-License-Identifier: MIT */
#include "tests/wire/replay_rig.h"

#include "drivers/protocol/native.h"

static void take(struct tape *tape, const uint8_t *bytes, const struct tape_frame *like)
{
    if (tape->len + like->len > tape->room) {
        tape->room = 2 * (tape->len + like->len);
        tape->bytes = realloc(tape->bytes, tape->room);
    }
    if (tape->n == tape->n_room) {
        tape->n_room = 2 * tape->n_room + 256;
        tape->frame = realloc(tape->frame, tape->n_room * sizeof *tape->frame);
    }
    assert_true(tape->bytes != NULL && tape->frame != NULL);
    memmove(tape->bytes + tape->len, bytes, like->len);
    tape->frame[tape->n] = *like;
    tape->frame[tape->n++].at = tape->len;
    tape->len += like->len;
}

void tape_add(struct tape *tape, const struct scanhead_frame *frame, int tick)
{
    take(tape, frame->raw,
         &(struct tape_frame){.len = (uint32_t)frame->raw_len,
                              .seq = frame->seq,
                              .type = frame->type,
                              .flags = frame->flags,
                              .tick = tick,
                              .t_ns = frame->t_ns});
}

void tape_free(struct tape *tape)
{
    free(tape->bytes);
    free(tape->frame);
    memset(tape, 0, sizeof *tape);
}

const char *tape_write(const struct wire *wire, const char *name, const struct tape *tape)
{
    return wire_write(wire, name, tape->bytes, tape->len);
}

void tape_keep_common(struct tape *tape)
{
    const uint32_t n = tape->n;
    tape->len = tape->n = 0;
    for (uint32_t i = 0; i < n; i++) {
        const struct tape_frame frame = tape->frame[i]; /* kept frames only overwrite places before it */
        if ((frame.flags & SCANHEAD_LOCAL) == 0) take(tape, tape->bytes + frame.at, &frame);
    }
}

void tape_read(const char *path, struct tape *tape)
{
    struct scanhead *sh = client_open(path);
    struct scanhead_frame frame;
    int rc;
    while ((rc = scanhead_next(sh, &frame, DEADLINE_MS)) == SCANHEAD_OK)
        tape_add(tape, &frame, 0);
    if (rc != SCANHEAD_ECLOSED) fail_msg("%s: %s", path, scanhead_error(sh));
    scanhead_close(sh);
}

void tape_step(struct wire *wire, const char *what, const char *const *more, const struct tape_line *lines, int n,
               struct tape *tape)
{
    const char *args[WIRE_MAX_ARGS] = {"--pace", "step", "--quiet"};
    struct scanhead_frame frame;
    for (int i = 3; more != NULL && *more != NULL; i++)
        args[i] = *more++;
    struct head head = head_start(wire, what, args);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    for (int tick = 0; tick < n; tick++) {
        for (; lines->command != NULL && lines->tick == tick; lines++)
            client_tell(sh, lines->command);
        client_tell(sh, "TIME:STEP 1 MS");
        while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK)
            tape_add(tape, &frame, tick);
    }
    assert_null(lines->command);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

void tape_same_bytes(const struct tape *tape, const struct tape *want)
{
    for (uint32_t i = 0; i < tape->n && i < want->n; i++) {
        const struct tape_frame *a = &tape->frame[i], *b = &want->frame[i];
        if (a->len != b->len || memcmp(tape->bytes + a->at, want->bytes + b->at, a->len) != 0)
            fail_msg("frame %u of type %d, number %u; wanted: type %d, number %u", i, a->type, a->seq, b->type, b->seq);
    }
    assert_int_equal(tape->n, want->n);
}

void tape_same_ticks(const struct tape *tape, const struct tape *want)
{
    tape_same_bytes(tape, want);
    assert_true(tape->n > 0);
    for (uint32_t i = 0; i < tape->n; i++) {
        const int after = tape->frame[i].tick - tape->frame[0].tick, had = want->frame[i].tick - want->frame[0].tick;
        if (after != had)
            fail_msg("frame %u of type %d, number %u, of %.6f ms: tick %d after the first, wanted %d", i,
                     tape->frame[i].type, tape->frame[i].seq, 1e-6 * (double)tape->frame[i].t_ns, after, had);
    }
}

int replay_call(struct wire *wire, const char *const *args)
{
    return wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
}

void replay_said(const struct wire *wire, const char *text)
{
    char *said = wire_read(wire_path(wire, "err"), NULL);
    if (strstr(said, text) == NULL) fail_msg("'%s' is not in: %s", text, said);
    free(said);
}

void replay_to_file(struct wire *wire, const char *file, const char *const *more, const char *out)
{
    char link[400], stats[352];
    snprintf(link, sizeof link, "type: file, path: '%s'", wire_path(wire, out));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *args[WIRE_MAX_ARGS] = {"run",    file, "--start", "--pace", "fast",
                                       "--link", link, "--stats", stats,    "--quiet"};
    for (int i = 10; more != NULL && *more != NULL; i++)
        args[i] = *more++;
    const int status = replay_call(wire, args);
    if (status != 0) wire_show(wire, "err");
    assert_int_equal(status, 0);
}

void replay_same_file(const struct wire *wire, const char *out, const char *of)
{
    struct tape got = {0}, want = {0};
    tape_read(wire_path(wire, of), &want);
    tape_read(wire_path(wire, out), &got);
    assert_true(want.n > 100);
    tape_same_bytes(&got, &want);
    tape_free(&got);
    tape_free(&want);
}

const char *replay_room(struct wire *wire, const char *name, unsigned lines)
{
    struct room_config config = {.prr_hz = 10000, .lines_hz = 100, .pan_deg_s = 10, .frames = 1};
    char links[400];
    snprintf(links, sizeof links, "links: [{type: file, path: '%s'}]\n", wire_path(wire, name));
    config.links = links;
    config.pan_stop_deg = 0.1 * lines;
    room_write(wire);
    const char *const args[] = {"run",       room_config_write(wire, &config),
                                "--start",   "--frames",
                                "1",         "--pace",
                                "fast",      "--quiet",
                                "--threads", "1",
                                NULL};
    const int status = replay_call(wire, args);
    if (status != 0) wire_show(wire, "err");
    assert_int_equal(status, 0);
    return wire_path(wire, name);
}
