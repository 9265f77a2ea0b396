/* Sessions of the GNSS receiver: the same links, with NMEA sentences instead of the head's frames. */
#include "drivers/protocol/nmea.h"
#include "firmware_sim/device/gnss.h"
#include "firmware_sim/loop/pump_inside.h"

static uint64_t count_at(const struct pump *pump, uint64_t tick)
{
    return gnss_count(device_gnss(pump->links->device), (int64_t)tick * pump->stream->tick_ns);
}

static uint32_t sentences_between(const struct pump *pump, uint64_t from_tick, uint64_t to_tick)
{
    return (uint32_t)(NMEA_ALL_SENTENCES * (count_at(pump, to_tick) - count_at(pump, from_tick)));
}

uint32_t pump_nmea_backlog(const struct pump *pump, const struct session *s)
{
    return sentences_between(pump, s->cursor, stream_released(pump->stream));
}

/* The tick of the first position from the cursor on. */
static uint64_t next_tick(const struct pump *pump, const struct session *s)
{
    const struct gnss *gnss = device_gnss(pump->links->device);
    return (uint64_t)(gnss_time_ns(gnss, count_at(pump, s->cursor)) / pump->stream->tick_ns);
}

/* As for frames: what is more than a queue old is lost, and the reader goes on with what is half a queue
 * old. */
static void lose_old(struct pump *pump, struct session *s, uint64_t released)
{
    uint64_t queue_ticks = pump->stream->ring.queue_ticks;
    if (pump->stream->waits || next_tick(pump, s) + queue_ticks >= released) return;
    uint64_t to = released - queue_ticks / 2;
    session_count_lost(pump, s, sentences_between(pump, s->cursor, to), 0);
    s->cursor = to;
}

void pump_take_nmea(struct pump *pump, struct session *s)
{
    uint64_t released = stream_released(pump->stream);
    lose_old(pump, s, released);
    while (s->cursor < released && s->out_len + NMEA_MAX_ALL < BATCH_BYTES) {
        uint64_t index = count_at(pump, s->cursor), tick = next_tick(pump, s);
        if (tick >= released) {
            s->cursor = released;
            s->lost.lagging = 0;
            break;
        }
        s->out_len += (uint32_t)device_gnss_sentences(pump->links->device, index, (char *)s->out + s->out_len,
                                                      pump->out_cap - s->out_len);
        s->cursor = tick + 1;
    }
}

void pump_skip_nmea(struct pump *pump, int index)
{
    char nothing[4096];
    while (pump->ops->read(pump->link, index, nothing, sizeof nothing) > 0)
        continue;
}
