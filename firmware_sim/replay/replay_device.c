/* SPDX-License-Identifier: MIT */
/* A recording as a device of another protocol than the native one: whether it can be that device, its time of day and
 * the fixes of its receiver. */
#include <math.h>

#include "core/utc.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/replay/replay_state.h"

/* ---- which device it can be */

/* All three are 0 where no place is configured (drivers/protocol/ANCHOR.md). A latitude of 0 alone is on the equator.
 * */
static int stands_on_earth(const struct native_anchor *a)
{
    return (a->moving & NATIVE_MOVING) == 0 && (a->lat_deg != 0.0 || a->lon_deg != 0.0 || a->height_m != 0.0);
}

/* Checks that the stream has all that the protocol needs, except for the emitter. NULL: nothing is missing; else a text
 * says what is. Amplitudes may be missing: protocols then use reflectances. */
static const char *lacks(const struct replay *r, const struct protocol_ops *ops, const struct native_descriptor *d,
                         const struct native_emitter *e)
{
    const int first = e != NULL && e->echoes == NATIVE_ECHOES_FIRST;
    if ((ops->needs & PROTOCOL_NEEDS_POLAR) != 0 && d->layout != NATIVE_POLAR)
        return "has positions instead of ranges (layout geo); required is layout polar";
    if ((ops->needs & PROTOCOL_NEEDS_LAST) != 0 && first)
        return "has first echoes alone; required is all, last or strongest";
    if ((ops->needs & PROTOCOL_NEEDS_TIME) != 0 && r->clock.n == 0)
        return "has no time of day; required is a recording of a head with time.epoch";
    if ((ops->needs & PROTOCOL_NEEDS_PLACE) != 0 && !stands_on_earth(&r->anchor))
        return "has no place on the Earth where it stands; required is a station with one";
    return NULL;
}

static int check_emitter(const struct protocol_ops *ops, const struct native_descriptor *d,
                         const struct native_emitter *e, const uint8_t *beams, struct sh_err *err)
{
    const uint32_t kind = e != NULL ? e->kind : (uint32_t)NATIVE_EMIT_LINE;
    if (ops->emitters != 0 && (ops->emitters & 1u << kind) == 0)
        return sh_fail(err, SH_EINPUT, "emitter %s; allowed is %s", emitter_names[kind],
                       emitter_names[(ops->emitters & 1u << EMITTER_PLANAR) != 0 ? EMITTER_PLANAR : EMITTER_BEAMS]);
    if (kind == NATIVE_EMIT_BEAMS && ops->n_beams != 0 && e->n_beams != ops->n_beams)
        return sh_fail(err, SH_EINPUT, "%u rings; allowed are %u", e->n_beams, ops->n_beams);
    return ops->check_head != NULL && e != NULL ? ops->check_head(d, e, beams, err) : SH_OK;
}

int replay_check_links(struct replay *r, const struct native_descriptor *d, const struct native_emitter *e,
                       const uint8_t *beams, struct sh_err *err)
{
    const struct config *cfg = r->cfg;
    for (uint32_t i = 0; i < cfg->n_links; i++) {
        const struct protocol_ops *ops = protocol_ops_get((enum protocol_id)cfg->link[i].protocol);
        struct sh_err why;
        if (ops->passes_native) continue;
        if (cfg->link[i].protocol == PROTOCOL_CAPTURE)
            return sh_fail(err, SH_EINPUT,
                           "%s: links[%u].protocol capture: %s is a recording, no capture; allowed are "
                           "the other protocols",
                           cfg->file, i, r->options.path);
        const char *lack = lacks(r, ops, d, e);
        if (lack != NULL)
            return sh_fail(err, SH_EINPUT, "%s: links[%u].protocol %s: %s %s", cfg->file, i, ops->name, r->options.path,
                           lack);
        if (check_emitter(ops, d, e, beams, &why) != SH_OK)
            return sh_fail(err, SH_EINPUT,
                           "%s: links[%u].protocol %s: the device can't be the head of %s, which has %s", cfg->file, i,
                           ops->name, r->options.path, why.text);
        if (r->options.speed != 1.0)
            return sh_fail(err, SH_EINPUT,
                           "%s: links[%u].protocol %s: its times are those of the device; allowed is --speed 1",
                           cfg->file, i, ops->name);
    }
    return SH_OK;
}

/* ---- time of day */

int64_t replay_date_ns(void *self, int64_t t_ns)
{
    struct replay *r = self;
    pthread_mutex_lock(&r->lock);
    const int64_t utc_ns = replay_clock_head_ns(&r->clock, t_ns);
    pthread_mutex_unlock(&r->lock);
    return utc_ns != INT64_MIN ? utc_ns : t_ns;
}

static int64_t receiver_ns(struct replay *r, int64_t t_ns)
{
    pthread_mutex_lock(&r->lock);
    const int64_t utc_ns = replay_clock_receiver_ns(&r->clock, t_ns);
    pthread_mutex_unlock(&r->lock);
    return utc_ns;
}

enum protocol_pps replay_pps(void *self, int64_t t_ns, int64_t *hour_ns)
{
    const int64_t utc_ns = receiver_ns(self, t_ns);
    *hour_ns = (utc_ns != INT64_MIN ? utc_ns : t_ns) % (3600 * UTC_SECOND_NS);
    return utc_ns != INT64_MIN ? PROTOCOL_PPS_LOCKED : PROTOCOL_PPS_ABSENT;
}

/* The receiver has one fix a second, at full seconds. */
int64_t replay_next_fix_ns(void *self, int64_t t_ns)
{
    const int64_t utc_ns = receiver_ns(self, t_ns);
    if (utc_ns == INT64_MIN) return INT64_MAX;
    const int64_t since_ns = utc_ns % UTC_SECOND_NS;
    return since_ns == 0 ? t_ns : t_ns + UTC_SECOND_NS - since_ns;
}

/* Gives the station's place. Where the head moves, the fix is invalid: the stream has its path in the scene's frame
 * alone. */
int replay_fix(void *self, int64_t t_ns, struct nmea_fix *fix)
{
    struct replay *r = self;
    struct utc_time utc;
    pthread_mutex_lock(&r->lock);
    const int is_known = replay_clock_receiver_ns(&r->clock, t_ns) != INT64_MIN;
    if (is_known) replay_clock_receiver_utc(&r->clock, t_ns, &utc);
    const struct native_anchor a = r->anchor;
    pthread_mutex_unlock(&r->lock);
    if (!is_known) return 0;
    *fix = (struct nmea_fix){.talker = {'G', 'N'},
                             .year = utc.year,
                             .month = utc.month,
                             .day = utc.day,
                             .hour = utc.hour,
                             .minute = utc.minute,
                             .second = utc.second,
                             .quality = stands_on_earth(&a),
                             .satellites = 12,
                             .hdop = 0.7,
                             .lat_deg = a.lat_deg,
                             .lon_deg = a.lon_deg,
                             .altitude_m = a.height_m,
                             .course_deg = NAN};
    return 1;
}
