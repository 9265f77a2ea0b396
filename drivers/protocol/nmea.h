/* SPDX-License-Identifier: MIT */
/* A GNSS fix goes in, NMEA 0183 sentences (versions 2.3 to 4.0) come out.
 *
 * A sentence is "$", talker and type, fields with commas between, "*", the XOR of all characters between "$" and "*" as
 * two upper-case hex digits, CR LF. The standard allows 82 characters, and readers drop longer ones. Here are 81 at
 * most: readers with a buffer of 80 take these, too. As with survey receivers, minutes have 7 decimals (a step is 0.19
 * mm), and heights 3. Where that is too long, there are fewer: minutes 6 (1.9 mm); then heights and speeds 2; then
 * minutes 5. The geoid separation has no zeros at its end but the first decimal.
 *
 * A field that isn't known is empty. But GSA numbers its satellites from 1 on, since single satellites are not
 * modelled. Without a fix (quality 0) all fields of the position are empty. At rest the course is 000.0.
 * Each function returns the length of the sentence with its end, and ends it by a NUL; 0 when cap is too
 * small. Pure; writes only into dst; allocates nothing; real-time safe. */
#ifndef DRIVERS_PROTOCOL_NMEA_H
#define DRIVERS_PROTOCOL_NMEA_H

#include <stddef.h>
#include <stdint.h>

enum {
    NMEA_MOST_LEN = 81,
    NMEA_MAX_SENTENCE = 160,
    NMEA_ALL_SENTENCES = 5,
    NMEA_MAX_ALL = NMEA_ALL_SENTENCES * NMEA_MAX_SENTENCE
};

struct nmea_fix {
    char talker[2];       /* "GN", "GP" */
    int year, month, day; /* UTC */
    int hour, minute;
    int second, hundredth;     /* second 60 in a leap second */
    double lat_deg, lon_deg;   /* WGS 84; north and east positive; -90..90, -180..180 */
    double altitude_m;         /* above the geoid */
    double geoid_separation_m; /* geoid above the ellipsoid; ellipsoidal height = altitude + separation */
    int quality;               /* of GGA: 0 none, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK float */
    int is_spoilt;             /* each bit of the checksums is wrong */
    int satellites;
    double hdop;
    double speed_m_s, course_deg; /* over ground; course NaN: at rest */
    double sigma_m[3];            /* of latitude, longitude, altitude */
};

size_t nmea_encode_gga(char *dst, size_t cap, const struct nmea_fix *fix);
size_t nmea_encode_rmc(char *dst, size_t cap, const struct nmea_fix *fix);
/* Writes an RMC with so few decimals that it has at most so many characters with its end, 72 or more. */
size_t nmea_encode_rmc_within(char *dst, size_t cap, const struct nmea_fix *fix, size_t most);
size_t nmea_encode_gsa(char *dst, size_t cap, const struct nmea_fix *fix);
size_t nmea_encode_gst(char *dst, size_t cap, const struct nmea_fix *fix);
size_t nmea_encode_zda(char *dst, size_t cap, const struct nmea_fix *fix);
/* All of them: RMC GGA GSA GST ZDA. */
size_t nmea_encode_all(char *dst, size_t cap, const struct nmea_fix *fix);

/* The members `content` and `reseal` of protocol_ops: nmea_content marks the bits that an injected fault may change in
 * decimals after a point. A changed decimal is still a digit, so each field stays a number. nmea_reseal corrects the
 * checksums of the sentences. */
void nmea_content(const uint8_t *bytes, size_t len, uint8_t *mask);
void nmea_reseal(uint8_t *bytes, size_t len);

#endif
