/* SPDX-License-Identifier: MIT */
/* Hands notices of the parser, of the exchange of lines and of the connection to the user's function, as they come. */
#include <string.h>

#include "drivers/host/host.h"

_Static_assert(SCANHEAD_NOTICE_GAP == (int)NATIVE_GAP && SCANHEAD_NOTICE_REPEATED == (int)NATIVE_REPEATED &&
                   SCANHEAD_NOTICE_LATE == (int)NATIVE_LATE && SCANHEAD_NOTICE_RESTARTED == (int)NATIVE_RESTARTED &&
                   SCANHEAD_NOTICE_BAD_PAYLOAD == (int)NATIVE_BAD_PAYLOAD &&
                   SCANHEAD_NOTICE_BAD_BYTES == (int)NATIVE_BAD_BYTES && SCANHEAD_NOTICE_CUT == (int)NATIVE_CUT,
               "the kinds that the parser gives");
_Static_assert(SCANHEAD_NO_TIME == NATIVE_NO_TIME, "a time that is not known");

static void give(struct scanhead *sh, const struct scanhead_notice *notice)
{
    if (sh->notices.fn != NULL) sh->notices.fn(sh->notices.ctx, notice);
}

static void from_parser(void *ctx, const struct native_notice *n)
{
    const struct scanhead_notice notice = {
        .kind = (enum scanhead_notice_kind)n->kind, .seq = n->seq, .at_byte = n->at_byte, .n = n->n, .t_ns = n->t_ns};
    give(ctx, &notice);
}

void host_listen(struct scanhead *sh)
{
    sh->parser.notice = from_parser;
    sh->parser.notice_ctx = sh;
}

void scanhead_on_notice(struct scanhead *sh, void (*fn)(void *ctx, const struct scanhead_notice *notice), void *ctx)
{
    sh->notices.fn = fn;
    sh->notices.ctx = ctx;
}

void host_note_line(struct scanhead *sh, int is_echo)
{
    struct host_notices *o = &sh->notices;
    const size_t len = strlen(sh->parser.text);
    struct scanhead_notice notice = {
        .kind = SCANHEAD_NOTICE_ECHO, .at_byte = sh->parser.text_at, .n = len, .t_ns = sh->parser.last_t_ns};
    if (is_echo) {
        o->echoes++;
    } else if (o->given_up > 0) {
        o->given_up--;
        o->late_replies++;
        notice.kind = SCANHEAD_NOTICE_LATE_REPLY;
    } else {
        o->unasked++;
        notice.kind = SCANHEAD_NOTICE_UNASKED;
    }
    give(sh, &notice);
}

void host_note_refused(struct scanhead *sh, const struct native_header *header, uint64_t at_byte)
{
    const struct scanhead_notice notice = {.kind = SCANHEAD_NOTICE_REFUSED,
                                           .seq = header->seq,
                                           .at_byte = at_byte,
                                           .n = 1,
                                           .t_ns = header->t_ns,
                                           .why = sh->err.text};
    sh->notices.refused++;
    give(sh, &notice);
}

static void note_connection(struct scanhead *sh, enum scanhead_notice_kind kind, uint64_t n)
{
    const struct scanhead_notice notice = {
        .kind = kind, .at_byte = sh->parser.stats.bytes, .n = n, .t_ns = sh->parser.last_t_ns};
    give(sh, &notice);
}

void host_note_closed(struct scanhead *sh)
{
    if (sh->notices.close_told || sh->source.is_file) return;
    sh->notices.close_told = 1;
    sh->notices.closed++;
    const int why = sh->reset ? SCANHEAD_ERESET : sh->lost ? SCANHEAD_ELOST : SCANHEAD_ECLOSED;
    note_connection(sh, SCANHEAD_NOTICE_CLOSED, (uint64_t)-why);
}

void host_note_reattached(struct scanhead *sh)
{
    sh->notices.close_told = 0;
    sh->notices.given_up = sh->notices.identities = 0; /* replies of another connection don't come any more */
    sh->notices.reattached++;
    note_connection(sh, SCANHEAD_NOTICE_REATTACHED, 1);
}

const char *scanhead_notice_name(int kind)
{
    static const char *const name[] = {
        [SCANHEAD_NOTICE_GAP] = "gap",
        [SCANHEAD_NOTICE_REPEATED] = "repeated",
        [SCANHEAD_NOTICE_LATE] = "late",
        [SCANHEAD_NOTICE_RESTARTED] = "restarted",
        [SCANHEAD_NOTICE_BAD_PAYLOAD] = "bad payload",
        [SCANHEAD_NOTICE_BAD_BYTES] = "bad bytes",
        [SCANHEAD_NOTICE_CUT] = "cut",
        [SCANHEAD_NOTICE_ECHO] = "echo",
        [SCANHEAD_NOTICE_LATE_REPLY] = "late reply",
        [SCANHEAD_NOTICE_UNASKED] = "unasked",
        [SCANHEAD_NOTICE_CLOSED] = "closed",
        [SCANHEAD_NOTICE_REATTACHED] = "reattached",
        [SCANHEAD_NOTICE_REFUSED] = "refused",
    };
    return kind > 0 && kind < (int)(sizeof name / sizeof name[0]) ? name[kind] : "?";
}
