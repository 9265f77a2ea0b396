/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/cost_watch.h"

#include <stdatomic.h>
#include <stdlib.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop_inside.h"
#include "firmware_sim/site/plan_rows.h"

static const double TIMES = 10.0;
static const double TICK_NS = 10000.0; /* processor time of a tick without its pulses; an upper bound */
static const int64_t EVERY_NS = 1000000000;

struct cost_watch {
    struct loop *loop;
    struct cost_figures figures;
    struct wakeup wakeup;
    _Atomic int ending;
    pthread_t thread;
    uint32_t n;
    clockid_t clock[CONFIG_MAX_THREADS]; /* of the casters; they may have ended when it is read */
};

/* A head that rests releases ticks without pulses: their time is not counted. Where no tick is released either, the
 * casters work on pulses that are claimed already, so that time is counted. */
double cost_add(struct cost_figures *f, const struct cost_sample *now)
{
    const struct cost_sample last = f->last;
    f->last = *now;
    if (now->pulses == last.pulses && now->ticks != last.ticks) return 0.0;
    f->sum.cast_ns += now->cast_ns - last.cast_ns;
    f->sum.pulses += now->pulses - last.pulses;
    f->sum.ticks += now->ticks - last.ticks;
    if (f->sum.cast_ns < COST_LEAST_NS) return 0.0;
    const double of_pulses_ns = (double)f->sum.cast_ns - TICK_NS * (double)f->sum.ticks;
    const double ns = of_pulses_ns / (double)(f->sum.pulses + f->open_pulses);
    f->sum = (struct cost_sample){0};
    return ns > TIMES * f->planned_ns ? ns : 0.0;
}

/* 0: a caster has ended. */
static int take_sample(const struct cost_watch *watch, struct cost_sample *sample)
{
    const struct loop *loop = watch->loop;
    *sample = (struct cost_sample){.pulses = atomic_load(&loop->stream.counters->cast),
                                   .ticks = stream_released(&loop->stream)};
    for (uint32_t i = 0; i < watch->n; i++) {
        int64_t ns;
        if (!clock_read_of_thread(watch->clock[i], &ns)) return 0;
        sample->cast_ns += ns;
    }
    return 1;
}

static void cost_watch_warn(const struct cost_watch *watch, double ns)
{
    char reason[128];
    site_cost_reason(watch->loop->site, reason, sizeof reason);
    sh_warn(
        watch->loop->options.report,
        "%s: a pulse takes %.3g us of processor time, more than ten times the %.3g us that are planned, and the run "
        "takes that much longer if casting is its slowest stage; possible causes: %s",
        watch->loop->cfg->file, 1e-3 * ns, 1e-3 * watch->figures.planned_ns, reason);
}

static void *watch_main(void *arg)
{
    struct cost_watch *watch = arg;
    struct cost_sample sample;
    double ns = 0.0;
    while (ns == 0.0) {
        const int64_t until_ns = clock_now_ns() + EVERY_NS;
        while (!atomic_load(&watch->ending) && !wakeup_sleep_until(&watch->wakeup, until_ns))
            continue;
        if (atomic_load(&watch->ending) || !take_sample(watch, &sample)) return NULL;
        watch->figures.open_pulses = watch->n * atomic_load(&watch->loop->casters.most_claimed);
        ns = cost_add(&watch->figures, &sample);
    }
    cost_watch_warn(watch, ns);
    return NULL;
}

struct cost_watch *cost_watch_start(struct loop *loop)
{
    const struct casters *casters = &loop->casters;
    const double given_ns = loop->options.planned_ns;
    struct cost_watch *watch = loop->options.report != NULL ? calloc(1, sizeof *watch) : NULL;
    if (watch == NULL) return NULL;
    watch->loop = loop;
    watch->n = casters->n_running;
    watch->figures.planned_ns = given_ns > 0.0 ? given_ns : site_planned_ns(loop->site);
    int rc = 0;
    for (uint32_t i = 0; i < watch->n && rc == 0; i++)
        rc = pthread_getcpuclockid(casters->caster[i].thread, &watch->clock[i]);
    wakeup_create(&watch->wakeup);
    if (rc == 0) rc = pthread_create(&watch->thread, NULL, watch_main, watch);
    if (rc == 0) return watch;
    wakeup_free(&watch->wakeup);
    free(watch);
    return NULL;
}

void cost_watch_join(struct cost_watch *watch)
{
    if (watch == NULL) return;
    atomic_store(&watch->ending, 1);
    wakeup_signal(&watch->wakeup, 1);
    pthread_join(watch->thread, NULL);
    wakeup_free(&watch->wakeup);
    free(watch);
}
