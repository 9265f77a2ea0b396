/* SPDX-License-Identifier: MIT */
#include "tests/unit/plain_source.h"

static void session_opened(void *self, uint32_t session, const char *who)
{
    (void)self, (void)session, (void)who;
}

static void session_closed(void *self, uint32_t session, const char *who, int partial)
{
    (void)self, (void)session, (void)who, (void)partial;
}

static void report(void *self, int number, const char *text)
{
    struct plain_source *source = self;
    (void)number, (void)text;
    source->n_reports++;
}

static struct fault_board *no_faults(const void *self)
{
    (void)self;
    return NULL;
}

static int64_t tick_ns(const void *self)
{
    (void)self;
    return 1000000;
}

static struct device_counters *get_counters(void *self)
{
    return &((struct plain_source *)self)->counters;
}

static uint64_t rests_from(void *self)
{
    (void)self;
    return 0;
}

static uint64_t scans(void *self)
{
    return ((struct plain_source *)self)->n_scans;
}

static void end(void *self)
{
    atomic_store(&((struct plain_source *)self)->ending, 1);
}

static int never(const void *self)
{
    (void)self;
    return 0;
}

static int close_files(void *self, struct sh_err *err)
{
    struct plain_source *source = self;
    (void)err;
    source->n_closed++;
    if (source->closed != NULL) source->closed(source);
    return SH_OK;
}

static uint32_t some_bytes(const void *self)
{
    (void)self;
    return 4096;
}

static void describe(void *self, struct ring_tick *tick)
{
    (void)self;
    *tick = (struct ring_tick){.bytes = NULL};
}

static enum loop_source_tick next(void *self, uint64_t tick, int may_idle, int again, struct ring_tick *out)
{
    struct plain_source *source = self;
    (void)may_idle;
    *out = (struct ring_tick){.bytes = NULL};
    return source->next != NULL ? source->next(source, tick, again, out) : LOOP_SOURCE_OVER;
}

const struct loop_source_ops plain_source_ops = {.session_opened = session_opened,
                                                 .session_closed = session_closed,
                                                 .report = report,
                                                 .faults = no_faults,
                                                 .rests_from = rests_from,
                                                 .tick_ns = tick_ns,
                                                 .counters = get_counters,
                                                 .scans = scans,
                                                 .end = end,
                                                 .files_fill = never,
                                                 .close_files = close_files,
                                                 .most_bytes = some_bytes,
                                                 .usual_bytes = some_bytes,
                                                 .describe = describe,
                                                 .next = next};
