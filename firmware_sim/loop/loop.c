#include "firmware_sim/loop/loop.h"

#include <errno.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "drivers/protocol/native.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/loop_inside.h"

enum { PACER_PRIORITY = 80 };

static uint32_t choose_threads(const struct config *cfg)
{
    long n = cfg->loop.threads != 0 ? (long)cfg->loop.threads : sysconf(_SC_NPROCESSORS_ONLN);
    return n < 1 ? 1 : n > LOOP_MAX_THREADS ? LOOP_MAX_THREADS : (uint32_t)n;
}

/* Bytes per second of the points at the rates that are set, of one echo a pulse: the least that there will be. A head
 * can be told to go faster later, and further echoes and the frames' heads come on top; what a link loses is told. */
static double stream_rate(const struct loop *loop)
{
    const struct config *cfg = loop->cfg;
    const struct head_settings *h = &cfg->head.settings;
    double sweep_udeg = 360e6 * cfg->profile.optical_gain / cfg->profile.facets;
    double used = (double)(h->line_stop_udeg - h->line_start_udeg) / sweep_udeg;
    double point_len = NATIVE_POINT_LEN + (cfg->output.attributes ? NATIVE_ATTRIBUTE_LEN : 0);
    return (double)h->prr_uhz * 1e-6 * (used < 1.0 ? used : 1.0) * point_len;
}

/* A link that can't carry the stream is refused before it loses any of it. */
static int check_capacity(const struct loop *loop, const struct pump *pump, struct sh_err *err)
{
    double capacity = pump_capacity(pump), rate = stream_rate(loop);
    char endpoint[300];
    if (capacity <= 0.0 || capacity >= rate || pump_is_nmea(pump)) return SH_OK;
    pump_endpoint(pump, endpoint, sizeof endpoint);
    return sh_fail(err, SH_EINPUT, "link %s: the stream has %.2f MB/s, the link carries %.2f MB/s; lower head.prr_hz%s",
                   endpoint, 1e-6 * rate, 1e-6 * capacity,
                   loop->cfg->output.attributes ? ", or leave out output.attributes" : "");
}

static int open_links(struct loop *loop, struct sh_err *err)
{
    const struct config *cfg = loop->cfg;
    int rc = SH_OK;
    for (uint32_t i = 0; i < cfg->n_links + (loop->options.extra != NULL) && rc == SH_OK; i++) {
        const struct link_spec *spec = i < cfg->n_links ? &cfg->link[i] : loop->options.extra;
        rc = pump_open(loop, i, spec, &loop->pump[i], err);
        if (rc != SH_OK) break;
        loop->n_pumps++;
        rc = check_capacity(loop, loop->pump[i], err);
    }
    return rc;
}

int loop_create(const struct site *site, struct device *device, const struct loop_options *options, struct loop **out,
                struct sh_err *err)
{
    *out = NULL;
    struct loop *loop = calloc(1, sizeof *loop);
    if (loop == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    const struct config *cfg = site->cfg;
    loop->site = site;
    loop->cfg = cfg;
    loop->device = device;
    loop->options = *options;
    loop->counters = device_counters(device);
    loop->tick_ns = (int64_t)device_tick_ns(device);
    loop->ahead_ticks = (uint64_t)(cfg->loop.ahead_ms * 1e6 / (double)loop->tick_ns) + 1;
    loop->slot_bytes = worker_slot_bytes(site);
    loop->n_threads = choose_threads(cfg);
    atomic_store(&loop->final_tick, UINT64_MAX);
    pthread_mutex_init(&loop->claim_lock, NULL);
    sem_init(&loop->work, 0, 0);
    sem_init(&loop->ready, 0, 0);
    sem_init(&loop->progress, 0, 0);
    uint64_t queue_ticks = (uint64_t)(cfg->loop.queue_ms * 1e6 / (double)loop->tick_ns) + 1;
    int rc = ring_create(&loop->ring, loop->ahead_ticks, queue_ticks, loop->slot_bytes, err);
    for (uint32_t i = 0; i < loop->n_threads && rc == SH_OK; i++)
        rc = worker_create(site, &loop->worker[i], err);
    if (rc == SH_OK) rc = open_links(loop, err);
    if (rc == SH_OK && cfg->platform.kind == PLATFORM_LIVE && cfg->loop.pace == PACE_REALTIME)
        rc = pose_feed_open(device, cfg, &loop->feed, err);
    if (rc != SH_OK) {
        loop_free(loop);
        return rc;
    }
    *out = loop;
    return SH_OK;
}

void loop_free(struct loop *loop)
{
    if (loop == NULL) return;
    pose_feed_close(loop->feed);
    for (uint32_t i = 0; i < loop->n_pumps; i++)
        pump_close(loop->pump[i]);
    for (uint32_t i = 0; i < loop->n_threads; i++)
        worker_free(loop->worker[i]);
    ring_free(&loop->ring);
    sem_destroy(&loop->work);
    sem_destroy(&loop->ready);
    sem_destroy(&loop->progress);
    pthread_mutex_destroy(&loop->claim_lock);
    free(loop);
}

int loop_endpoint(const struct loop *loop, uint32_t i, char *buf, size_t len)
{
    if (i == loop->n_pumps && loop->feed != NULL) {
        pose_feed_endpoint(loop->feed, buf, len);
        return 1;
    }
    if (i >= loop->n_pumps) return 0;
    pump_endpoint(loop->pump[i], buf, len);
    return 1;
}

static void put_endpoint(struct json *json, const char *type, const char *endpoint, int is_nmea)
{
    json_open_object(json, NULL);
    json_string(json, "type", type);
    json_string(json, "endpoint", endpoint);
    if (is_nmea) json_string(json, "protocol", "nmea");
    json_close_object(json);
}

void loop_put_endpoints(const struct loop *loop, struct json *json)
{
    char text[512];
    json_open_object(json, NULL);
    json_open_array(json, "endpoints");
    for (uint32_t i = 0; i < loop->n_pumps; i++) {
        pump_endpoint(loop->pump[i], text, sizeof text);
        put_endpoint(json, pump_type(loop->pump[i]), text, pump_is_nmea(loop->pump[i]));
    }
    if (loop->feed != NULL) {
        pose_feed_endpoint(loop->feed, text, sizeof text);
        put_endpoint(json, "pose", text, 0);
    }
    json_close_array(json);
    json_close_object(json);
}

/* The moment that is device time 0. */
static int power_up(struct loop *loop, struct sh_err *err)
{
    const char *warning;
    loop->epoch_ns = clock_now_ns();
    int rc = device_power_up(loop->device, loop->epoch_ns, &warning, err);
    if (rc == SH_OK && warning != NULL) sh_warn(loop->options.report, "%s", warning);
    return rc;
}

/* Real-time priority and locked memory where permitted; a warning where not. */
static int start_pacer(struct loop *loop, struct sh_err *err)
{
    pthread_attr_t attr;
    pthread_attr_init(&attr);
    int rt = !loop_waits(loop);
    if (rt) {
        struct sched_param param = {.sched_priority = PACER_PRIORITY};
        pthread_attr_setinheritsched(&attr, PTHREAD_EXPLICIT_SCHED);
        pthread_attr_setschedpolicy(&attr, SCHED_FIFO);
        pthread_attr_setschedparam(&attr, &param);
        if (mlockall(MCL_CURRENT) != 0)
            sh_warn(loop->options.report, "memory not locked (%s): paging may delay the loop; raise RLIMIT_MEMLOCK",
                    strerror(errno));
    }
    int rc = power_up(loop, err);
    if (rc != SH_OK) {
        pthread_attr_destroy(&attr);
        return rc;
    }
    rc = pthread_create(&loop->pacer_thread, &attr, loop_pacer_main, loop);
    if (rc == EPERM && rt) {
        sh_warn(loop->options.report, "no SCHED_FIFO for the pacing thread (%s): raise RLIMIT_RTPRIO to %d",
                strerror(rc), PACER_PRIORITY);
        rc = pthread_create(&loop->pacer_thread, NULL, loop_pacer_main, loop);
    }
    pthread_attr_destroy(&attr);
    if (rc != 0) return sh_fail(err, SH_EIO, "loop: no pacing thread: %s", strerror(rc));
    loop->pacer_running = 1;
    return SH_OK;
}

static int start_pumps(struct loop *loop, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < loop->n_pumps && rc == SH_OK; i++)
        rc = pump_start(loop->pump[i], err);
    return rc;
}

int loop_start(struct loop *loop, struct sh_err *err)
{
    int rc = loop->options.hash ? hasher_start(loop, &loop->hasher, err) : SH_OK;
    if (rc == SH_OK && loop->feed != NULL) rc = pose_feed_start(loop->feed, err);
    if (rc == SH_OK) rc = start_pumps(loop, err);
    if (rc == SH_OK) rc = start_pacer(loop, err);
    for (uint32_t i = 0; i < loop->n_threads && rc == SH_OK; i++) {
        loop->caster_arg[i] = (struct loop_caster){loop, loop->worker[i]};
        int e = pthread_create(&loop->caster_thread[i], NULL, loop_caster_main, &loop->caster_arg[i]);
        if (e != 0)
            rc = sh_fail(err, SH_EIO, "loop: no thread for a caster: %s", strerror(e));
        else
            loop->n_casters_running++;
    }
    return rc;
}

int loop_is_over(const struct loop *loop)
{
    return atomic_load(&loop->pacer_done) && atomic_load(&loop->pumps_busy) == 0;
}

void loop_end(struct loop *loop)
{
    device_end(loop->device);
    atomic_store(&loop->ending, 1);
    if (loop->cfg->loop.pace == PACE_STEP) atomic_store(&loop->granted, UINT64_MAX);
    loop_poke(loop);
}

/* Value below which the share q of all releases lies, in microseconds; buckets are an eighth of an octave wide. */
static double late_quantile_us(const struct loop *loop, double q)
{
    uint64_t total = 0, seen = 0;
    for (uint32_t i = 0; i < LATE_BUCKETS; i++)
        total += atomic_load(&loop->late[i]);
    for (uint32_t i = 0; i < LATE_BUCKETS && total != 0; i++) {
        seen += atomic_load(&loop->late[i]);
        if ((double)seen < q * (double)total) continue;
        double upper_ns = i < 8 ? (double)(i + 1) : (double)((uint64_t)(8 + i % 8 + 1) << (i / 8 - 1));
        return upper_ns * 1e-3;
    }
    return 0.0;
}

static void fill_stats(struct loop *loop, struct loop_stats *stats)
{
    const struct device_counters *c = loop->counters;
    stats->pulses = atomic_load(&c->pulses);
    stats->fired_pulses = atomic_load(&c->fired);
    stats->echoes = atomic_load(&c->echoes);
    stats->lines = atomic_load(&c->lines);
    stats->crowded = atomic_load(&c->crowded);
    stats->faint = atomic_load(&c->faint);
    stats->unfit = atomic_load(&c->unfit);
    stats->lost_pulses = atomic_load(&c->lost_pulses);
    stats->lost_ticks = atomic_load(&c->lost_ticks);
    stats->late_blocks = atomic_load(&c->late_blocks);
    stats->reader_lost_frames = atomic_load(&c->reader_lost_frames);
    stats->late_poses = atomic_load(&c->late_poses);
    stats->bad_poses = atomic_load(&c->bad_poses);
    stats->scans = device_scans(loop->device);
    stats->wall_s = 1e-9 * (double)(atomic_load(&loop->last_pulse_ns) - atomic_load(&loop->first_pulse_ns));
    stats->late_p50_us = late_quantile_us(loop, 0.5);
    stats->late_p999_us = late_quantile_us(loop, 0.999);
    stats->late_max_us = 1e-3 * (double)atomic_load(&c->late_max_ns);
}

int loop_check_links(const struct loop *loop, struct sh_err *err)
{
    if (!atomic_load(&loop->link_failed)) return SH_OK;
    return sh_fail(err, loop->link_error.code, "%s", loop->link_error.text);
}

void loop_join(struct loop *loop, struct loop_stats *stats)
{
    memset(stats, 0, sizeof *stats);
    if (loop->n_casters_running < loop->n_threads || !loop->pacer_running) { /* a start that failed half-way */
        atomic_store(&loop->stopping, 1);
        atomic_store(&loop->pacer_done, !loop->pacer_running);
        loop_poke(loop);
    }
    for (uint32_t i = 0; i < loop->n_casters_running; i++)
        pthread_join(loop->caster_thread[i], NULL);
    if (loop->pacer_running) pthread_join(loop->pacer_thread, NULL);
    for (uint32_t i = 0; i < loop->n_pumps; i++)
        pump_join(loop->pump[i]);
    if (loop->hasher != NULL) {
        hasher_wake(loop->hasher);
        stats->have_hash = hasher_join(loop->hasher, stats->sha256);
        loop->hasher = NULL;
    }
    fill_stats(loop, stats);
}
