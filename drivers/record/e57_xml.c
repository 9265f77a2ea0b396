/* SPDX-License-Identifier: MIT */
#include "drivers/record/e57_xml.h"

#include <inttypes.h>
#include <nettle/sha2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/record/crs_wkt.h"
#include "drivers/record/e57_note.h"

/* Names from the stream may hold anything. Characters that are not printable ASCII become '?'. */
static void put_string(FILE *out, const char *tag, const char *text)
{
    fprintf(out, "<%s type=\"String\">", tag);
    for (; *text != 0; text++) {
        unsigned char c = (unsigned char)*text;
        if (c == '&' || c == '<' || c == '>')
            fprintf(out, "&#%d;", c);
        else
            fputc(c < 0x20 || c > 0x7e ? '?' : c, out);
    }
    fprintf(out, "</%s>\n", tag);
}

static void put_float(FILE *out, const char *tag, double v)
{
    fprintf(out, "<%s type=\"Float\">%.17g</%s>\n", tag, v, tag);
}

static void put_integer(FILE *out, const char *tag, uint64_t v)
{
    fprintf(out, "<%s type=\"Integer\">%" PRIu64 "</%s>\n", tag, v, tag);
}

static void open_structure(FILE *out, const char *tag)
{
    fprintf(out, "<%s type=\"Structure\">\n", tag);
}

/* The guid is made from the scan's facts, so that the same stream gives the same file. `whose` keeps the guid of a file
 * with one scan apart from the scan's. The guid is a UUID of version 8 (RFC 9562). */
static void put_guid(FILE *out, const char *whose, const void *content, size_t len)
{
    struct sha256_ctx sha256;
    uint8_t d[SHA256_DIGEST_SIZE];
    sha256_init(&sha256);
    sha256_update(&sha256, strlen(whose), (const uint8_t *)whose);
    sha256_update(&sha256, len, content);
    sha256_digest(&sha256, sizeof d, d);
    d[6] = (uint8_t)((d[6] & 0x0f) | 0x80);
    d[8] = (uint8_t)((d[8] & 0x3f) | 0x80);
    fputs("<guid type=\"String\">{", out);
    for (int i = 0; i < 16; i++)
        fprintf(out, "%s%02x", i == 4 || i == 6 || i == 8 || i == 10 ? "-" : "", d[i]);
    fputs("}</guid>\n", out);
}

static void put_pose(FILE *out, const struct station_pose *pose)
{
    static const char *const name[] = {"w", "x", "y", "z"};
    double q[4];
    station_pose_quaternion(pose, q);
    open_structure(out, "pose");
    open_structure(out, "rotation");
    for (int i = 0; i < 4; i++)
        put_float(out, name[i], q[i]);
    fputs("</rotation>\n", out);
    open_structure(out, "translation");
    for (int i = 0; i < 3; i++)
        put_float(out, name[i + 1], pose->shift_m[i]);
    fputs("</translation>\n</pose>\n", out);
}

static void put_bounds(FILE *out, const struct e57_scan *s)
{
    static const char *const name[3][2] = {
        {"xMinimum", "xMaximum"}, {"yMinimum", "yMaximum"}, {"zMinimum", "zMaximum"}};
    if (s->n_points > 0) {
        open_structure(out, "cartesianBounds");
        for (int i = 0; i < 3; i++) {
            put_float(out, name[i][0], s->min[i] * s->scale_m);
            put_float(out, name[i][1], s->max[i] * s->scale_m);
        }
        fputs("</cartesianBounds>\n", out);
    }
    if (s->n_records > 0) {
        open_structure(out, "indexBounds");
        put_integer(out, "rowMinimum", s->row_min);
        put_integer(out, "rowMaximum", s->row_max);
        put_integer(out, "columnMinimum", s->column_min);
        put_integer(out, "columnMaximum", s->column_max);
        put_integer(out, "returnMinimum", 0);
        put_integer(out, "returnMaximum", s->return_max);
        fputs("</indexBounds>\n", out);
    }
    if (s->have_intensity) {
        open_structure(out, "intensityLimits");
        put_float(out, "intensityMinimum", s->intensity_min_cdb / 100.0);
        put_float(out, "intensityMaximum", s->intensity_max_cdb / 100.0);
        fputs("</intensityLimits>\n", out);
    }
}

/* The stream says which time it is, but not from which clock the head has it: GNSS, or its computer's. The standard
 * wants 1 only where an atomic clock is known to be the source. */
static void put_time(FILE *out, const char *tag, double gps_s)
{
    open_structure(out, tag);
    put_float(out, "dateTimeValue", gps_s);
    put_integer(out, "isAtomicClockReferenced", 0);
    fprintf(out, "</%s>\n", tag);
}

static const char *const colour_name[] = {"Red", "Green", "Blue"};

static void put_colour_limits(FILE *out)
{
    char tag[32];
    open_structure(out, "colorLimits");
    for (int i = 0; i < 6; i++) {
        snprintf(tag, sizeof tag, "color%s%s", colour_name[i / 2], i % 2 == 0 ? "Minimum" : "Maximum");
        put_integer(out, tag, i % 2 == 0 ? 0 : 255);
    }
    fputs("</colorLimits>\n", out);
}

/* Fields have the order and the widths of the packets' streams (e57_packet.h). */
static void put_prototype(FILE *out, const struct e57_facts *facts, const struct e57_scan *s)
{
    static const char *const xyz[] = {"cartesianX", "cartesianY", "cartesianZ"};
    open_structure(out, "prototype");
    for (int i = 0; i < 3; i++)
        fprintf(out,
                "<%s type=\"ScaledInteger\" minimum=\"-2147483648\" maximum=\"2147483647\" scale=\"%.17g\" "
                "offset=\"0\">0</%s>\n",
                xyz[i], s->scale_m, xyz[i]);
    if (facts->empty_shots)
        fputs("<cartesianInvalidState type=\"Integer\" minimum=\"0\" maximum=\"2\">0</cartesianInvalidState>\n", out);
    fputs("<intensity type=\"ScaledInteger\" minimum=\"-32768\" maximum=\"32767\" scale=\"0.01\" "
          "offset=\"0\">0</intensity>\n"
          "<isIntensityInvalid type=\"Integer\" minimum=\"0\" maximum=\"1\">0</isIntensityInvalid>\n",
          out);
    for (int i = 0; i < 3 && facts->has_colours; i++)
        fprintf(out, "<color%s type=\"Integer\" minimum=\"0\" maximum=\"255\">0</color%s>\n", colour_name[i],
                colour_name[i]);
    fputs("<timeStamp type=\"Float\" precision=\"double\">0</timeStamp>\n"
          "<returnIndex type=\"Integer\" minimum=\"0\" maximum=\"15\">0</returnIndex>\n"
          "<returnCount type=\"Integer\" minimum=\"0\" maximum=\"15\">0</returnCount>\n"
          "<rowIndex type=\"Integer\" minimum=\"0\" maximum=\"4294967295\">0</rowIndex>\n"
          "<columnIndex type=\"Integer\" minimum=\"0\" maximum=\"4294967295\">0</columnIndex>\n"
          "<sh:label type=\"Integer\" minimum=\"0\" maximum=\"65535\">0</sh:label>\n"
          "</prototype>\n",
          out);
}

static void put_scan(FILE *out, const struct e57_facts *facts, const struct e57_scan *s)
{
    char name[64], text[sizeof s->idn + 64];
    snprintf(name, sizeof name, "scan %u, station %u", s->number, s->station);
    open_structure(out, "vectorChild");
    put_guid(out, "", s, sizeof *s);
    put_string(out, "name", name);
    snprintf(text, sizeof text, "%s%s", s->idn,
             facts->is_incomplete && s->number == facts->n_scans ? "; repaired: its end is missing" : "");
    put_string(out, "description", text);
    put_string(out, "sensorModel", s->profile);
    put_pose(out, &s->pose);
    if (s->have_start) put_time(out, "acquisitionStart", s->start_gps_s);
    put_bounds(out, s);
    if (facts->has_colours) put_colour_limits(out);
    fprintf(out, "<sh:begin type=\"Blob\" fileOffset=\"%" PRIu64 "\" length=\"%d\"></sh:begin>\n",
            e57_physical(s->note), E57_NOTE_LEN - E57_BLOB_HEADER_LEN);
    fprintf(out, "<points type=\"CompressedVector\" fileOffset=\"%" PRIu64 "\" recordCount=\"%" PRIu64 "\">\n",
            e57_physical(s->section), s->n_records);
    put_prototype(out, facts, s);
    fputs("<codecs type=\"Vector\" allowHeterogeneousChildren=\"1\"></codecs>\n</points>\n</vectorChild>\n", out);
}

static void put_root(FILE *out, const struct e57_facts *facts)
{
    char wkt[CRS_WKT_MAX];
    fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
          "<e57Root type=\"Structure\" xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\" "
          "xmlns:sh=\"urn:scanhead:e57\">\n",
          out);
    put_string(out, "formatName", "ASTM E57 3D Imaging Data File");
    put_guid(out, "file", facts->scan, facts->n_scans * sizeof *facts->scan);
    put_integer(out, "versionMajor", 1);
    put_integer(out, "versionMinor", 0);
    put_string(out, "e57LibraryVersion", "scanhead");
    if (facts->n_scans > 0 && facts->scan[0].have_start) put_time(out, "creationDateTime", facts->scan[0].start_gps_s);
    if (crs_wkt(facts->epsg, facts->geoid_heights, wkt) > 0) put_string(out, "coordinateMetadata", wkt);
    fputs("<data3D type=\"Vector\" allowHeterogeneousChildren=\"1\">\n", out);
    for (uint32_t i = 0; i < facts->n_scans; i++)
        put_scan(out, facts, &facts->scan[i]);
    fputs("</data3D>\n<images2D type=\"Vector\" allowHeterogeneousChildren=\"1\"></images2D>\n</e57Root>\n", out);
}

int e57_xml(const struct e57_facts *facts, char **text, size_t *len, struct sh_err *err)
{
    *text = NULL;
    FILE *out = open_memstream(text, len);
    if (out != NULL) put_root(out, facts);
    if (out != NULL && fclose(out) == 0) return 0;
    free(*text);
    return sh_fail(err, SH_ENOMEM, "no memory for the XML section");
}
