/* SPDX-License-Identifier: MIT */
#include "tests/unit/notices_rig.h"

#include <pthread.h>

struct scanhead_notice noticed[NOTICES_MAX];
int n_noticed;
struct scanhead_stats noticed_stats;

static void on_notice(void *ctx, const struct scanhead_notice *notice)
{
    assert_true(n_noticed < NOTICES_MAX);
    noticed[n_noticed++] = *notice;
    scanhead_get_stats(ctx, &noticed_stats);
}

void listen_to(struct scanhead *sh)
{
    n_noticed = 0;
    scanhead_on_notice(sh, on_notice, sh);
}

void expect_notice(int i, enum scanhead_notice_kind kind, uint64_t at_byte, uint32_t seq, uint64_t n)
{
    assert_true(i < n_noticed);
    assert_string_equal(scanhead_notice_name(noticed[i].kind), scanhead_notice_name(kind));
    assert_int_equal(noticed[i].at_byte, at_byte);
    assert_int_equal(noticed[i].seq, seq);
    assert_int_equal(noticed[i].n, n);
}

size_t make_event(uint8_t *to, uint32_t seq)
{
    struct native_event e = {.code = NATIVE_EV_ERROR, .a = seq};
    assert_int_equal(native_encode_event(to, NOTICES_EVENT, &e, 10 + (int64_t)seq, 0), NOTICES_EVENT);
    native_finish_frame(to, seq);
    return NOTICES_EVENT;
}

void put_numbered(int fd, uint32_t seq)
{
    uint8_t raw[NOTICES_EVENT];
    put_all(fd, raw, make_event(raw, seq));
}

static void *play(void *arg)
{
    struct play *p = arg;
    p->ok = 1;
    for (const struct turn *t = p->turn; t->line != NULL; t++) {
        char line[64];
        size_t n = 0;
        while (n < sizeof line - 1 && read(p->fd, line + n, 1) == 1 && line[n] != '\n')
            n++;
        line[n] = 0;
        p->ok &= strcmp(line, t->line) == 0;
        if (t->len > 0) p->ok &= write(p->fd, t->answer, t->len) == (ssize_t)t->len;
    }
    return NULL;
}

int command_played(struct scanhead *sh, struct play *p, const char *line, char *reply, int timeout_ms)
{
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, play, p), 0);
    const int rc = scanhead_command(sh, line, reply, 64, timeout_ms);
    pthread_join(thread, NULL);
    assert_true(p->ok);
    return rc;
}
