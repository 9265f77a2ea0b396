/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/native.h"
#include "drivers/protocol/nmea.h"
#include "drivers/protocol/velodyne.h"

/* A position packet, 512 bytes, little-endian; what isn't named is 0.
 *
 *   0xbb u8 top board, deg C       0xbc u8 bottom board            0xbd u8 at the last ADC calibration
 *   0xbe i16 change since then     0xc0 u32 s since then           0xc4 u8 its reason   0xc5 u8 status
 *   0xc6 u32 us since the top of the hour                          0xca u8 enum protocol_pps
 *   0xcb u8 thermal status         0xcc u8 deg C at shut-down      0xcd u8 deg C at power-up
 *   0xce $GPRMC,... CR LF, 72 bytes at most: readers take as many for the sentence */
enum {
    AT_TOP = 0xbb,
    AT_BOTTOM = 0xbc,
    AT_ADC = 0xbd,
    AT_CHANGE = 0xbe,
    AT_CALIBRATED_S = 0xc0,
    AT_REASON = 0xc4,
    AT_TIME = 0xc6,
    AT_PPS = 0xca,
    AT_POWER_UP = 0xcd,
    AT_NMEA = 0xce,
};
enum { REASON_POWER_ON = 1 };
/* Warm electronics at rest. No temperature is modelled. */
enum { TOP_DEGC = 42, BOTTOM_DEGC = 39, ADC_DEGC = 40, POWER_UP_DEGC = 25 };
enum { MOST_AT_ONCE = 64, SENTENCE_LEN = 72 };

struct position {
    struct protocol_spec spec; /* its power-up counts as the last ADC calibration */
    int64_t next_ns;           /* device time of the next packet */
};

/* Times are multiples of the period, so that sessions agree. */
static void open_at(void *protocol, int64_t t_ns)
{
    struct position *p = protocol;
    p->next_ns = (t_ns + VELODYNE_POSITION_NS - 1) / VELODYNE_POSITION_NS * VELODYNE_POSITION_NS;
}

/* The sentence that the receiver sent last. */
static void put_sentence(const struct position *p, char *dst, int64_t t_ns)
{
    char sentence[NMEA_MAX_SENTENCE];
    struct nmea_fix fix;
    if (!p->spec.host.fix(p->spec.host.ctx, t_ns, &fix)) return;
    memcpy(fix.talker, "GP", 2);
    memcpy(dst, sentence, nmea_encode_rmc_within(sentence, sizeof sentence, &fix, SENTENCE_LEN));
}

static void send_packet(const struct position *p, int64_t t_ns)
{
    uint8_t packet[VELODYNE_POSITION_LEN] = {0};
    packet[AT_TOP] = TOP_DEGC;
    packet[AT_BOTTOM] = BOTTOM_DEGC;
    packet[AT_ADC] = ADC_DEGC;
    le_put16(packet + AT_CHANGE, TOP_DEGC - ADC_DEGC);
    le_put32(packet + AT_CALIBRATED_S, (uint32_t)((t_ns - p->spec.power_ns) / 1000000000));
    packet[AT_REASON] = REASON_POWER_ON;
    le_put32(packet + AT_TIME, velodyne_hour_us(&p->spec.host, t_ns));
    packet[AT_PPS] = (uint8_t)velodyne_pps(&p->spec.host, t_ns);
    packet[AT_POWER_UP] = POWER_UP_DEGC;
    put_sentence(p, (char *)packet + AT_NMEA, t_ns);
    p->spec.host.send(p->spec.host.ctx, packet, sizeof packet);
}

/* After a long silence of the head only the newest are sent. */
static void at_time(void *protocol, int64_t t_ns)
{
    struct position *p = protocol;
    if (t_ns <= p->next_ns) return;
    const int64_t due = (t_ns - p->next_ns + VELODYNE_POSITION_NS - 1) / VELODYNE_POSITION_NS;
    if (due > MOST_AT_ONCE) {
        p->spec.host.count(p->spec.host.ctx, PROTOCOL_UNITS_LOST, (uint64_t)(due - MOST_AT_ONCE));
        p->next_ns += (due - MOST_AT_ONCE) * VELODYNE_POSITION_NS;
    }
    for (; p->next_ns < t_ns; p->next_ns += VELODYNE_POSITION_NS)
        send_packet(p, p->next_ns);
}

static int64_t next_ns(const void *protocol)
{
    return ((const struct position *)protocol)->next_ns + 1;
}

const struct protocol_ops protocol_velodyne_position = {
    .name = "velodyne-position",
    .emitters = 1u << NATIVE_EMIT_BEAMS,
    .n_beams = VELODYNE_BEAMS,
    .max_unit = VELODYNE_POSITION_LEN,
    .content = nmea_content,
    .reseal = nmea_reseal,
    .size = sizeof(struct position),
    .open = open_at,
    .time = at_time,
    .input = protocol_lose_input,
    .next_ns = next_ns,
};
