/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/velodyne_pages.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/velodyne.h"
#include "drivers/protocol/velodyne_settings.h"

/* A document that is being written. */
struct page {
    const struct protocol_spec *spec;
    struct velodyne_state state;
    int64_t t_ns;
    char *dst;
    size_t cap, len;
};

static void velodyne_pages_put(struct page *p, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
static void velodyne_pages_put(struct page *p, const char *fmt, ...)
{
    va_list args;
    va_start(args, fmt);
    const int n = vsnprintf(p->dst + p->len, p->cap - p->len, fmt, args);
    va_end(args);
    p->len = n >= 0 && (size_t)n < p->cap - p->len ? p->len + (size_t)n : p->cap - 1;
}

/* A string of JSON, ASCII alone. */
static void put_string(struct page *p, const char *s)
{
    velodyne_pages_put(p, "\"");
    for (; *s != '\0'; s++)
        if ((unsigned char)*s < 32 || (unsigned char)*s > 126 || strchr("\"\\<>&", *s) != NULL)
            velodyne_pages_put(p, "\\u%04x", (unsigned)(unsigned char)*s);
        else
            velodyne_pages_put(p, "%c", *s);
    velodyne_pages_put(p, "\"");
}

static const char *on_off(int on)
{
    return on ? "On" : "Off";
}

/* "48 06.00N 11 30.00E"; without a fix "". */
static void put_position(struct page *p)
{
    struct nmea_fix fix;
    if (!p->spec->host.fix(p->spec->host.ctx, p->t_ns, &fix) || fix.quality == 0) {
        velodyne_pages_put(p, "\"\"");
        return;
    }
    const long lat = lround(fabs(fix.lat_deg) * 6000.0), lon = lround(fabs(fix.lon_deg) * 6000.0);
    velodyne_pages_put(p, "\"%ld %02ld.%02ld%c %ld %02ld.%02ld%c\"", lat / 6000, lat / 100 % 60, lat % 100,
                       fix.lat_deg < 0.0 ? 'S' : 'N', lon / 6000, lon / 100 % 60, lon % 100,
                       fix.lon_deg < 0.0 ? 'W' : 'E');
}

static void put_info(struct page *p)
{
    const struct protocol_identity *id = p->spec->identity;
    velodyne_pages_put(p, "{\"model\":");
    put_string(p, id->model);
    velodyne_pages_put(p, ",\"serial\":");
    put_string(p, id->serial);
    velodyne_pages_put(p, ",\"firmware\":");
    put_string(p, id->firmware);
    velodyne_pages_put(p, ",\"mac_addr\":\"02-00-00-00-00-00\"}"); /* locally administered: no maker's */
}

static void put_status(struct page *p)
{
    static const char *const words[] = {"Absent", "Synchronizing", "Locked", "Error"};
    velodyne_pages_put(p, "{\"gps\":{\"pps_state\":\"%s\",\"position\":", words[velodyne_pps(&p->spec->host, p->t_ns)]);
    put_position(p);
    velodyne_pages_put(
        p, "},\"motor\":{\"state\":\"%s\",\"rpm\":%u,\"lock\":\"%s\",\"phase\":%u},\"laser\":{\"state\":\"%s\"}}",
        on_off(p->state.motor_on), p->state.motor_on ? p->state.rpm : 0, on_off(p->state.is_locked), p->state.edge_cdeg,
        on_off(p->state.laser_on));
}

static void put_settings(struct page *p)
{
    velodyne_pages_put(p, "{\"laser\":\"%s\",\"returns\":\"%s\",\"rpm\":%u,\"fov\":{\"start\":0,\"end\":359},",
                       on_off(p->state.laser_on), p->state.returns, p->state.rpm);
    velodyne_pages_put(p, "\"phaselock\":{\"enabled\":\"%s\",\"offset\":%u,\"offsetInput\":%g},\"host\":{\"addr\":",
                       on_off(p->state.phase_lock), p->state.offset_cdeg, 0.01 * p->state.offset_cdeg);
    put_string(p, velodyne_host_address(p->spec));
    velodyne_pages_put(p, ",\"dport\":%d,\"tport\":%d},", velodyne_host_port(p->spec), velodyne_position_port(p->spec));
    velodyne_pages_put(
        p,
        "\"net\":{\"addr\":\"\",\"mask\":\"\",\"gateway\":\"\",\"dhcp\":\"Off\",\"mac_addr\":\"02-00-00-00-00-00\"}}");
}

/* Counts of a converter, 4096 for 5 V. By the user manual (10.2.3.2) these counts mean the values in the comments,
 * which are within the manual's ranges. None of them is modelled. */
static void put_diag(struct page *p)
{
    velodyne_pages_put(p, "{\"volt_temp\":{\"top\":{"
                          "\"hv\":2952,"         /* -141 V */
                          "\"ad_temp\":480,"     /* no published conversion */
                          "\"lm20_temp\":1126,"  /* 42 deg C */
                          "\"pwr_5v\":2048,"     /* 5.0 V */
                          "\"pwr_2_5v\":2048,"   /* 2.5 V */
                          "\"pwr_3_3v\":2703,"   /* 3.3 V */
                          "\"pwr_5v_raw\":2048," /* 5.0 V */
                          "\"pwr_raw\":2048,"
                          "\"pwr_vccint\":983},"); /* 1.2 V */
    velodyne_pages_put(p, "\"bot\":{"
                          "\"i_out\":2107,"     /* 0.72 A */
                          "\"pwr_1_2v\":983,"   /* 1.2 V */
                          "\"lm20_temp\":1155," /* 39 deg C */
                          "\"pwr_5v\":2048,"
                          "\"pwr_2_5v\":2048,"
                          "\"pwr_3_3v\":2703,"
                          "\"pwr_v_in\":894,"     /* 12.0 V */
                          "\"pwr_1_25v\":1024}}," /* 1.25 V */
                          "\"vhv\":0,\"adc_nf\":0,\"ixe\":0}");
}

/* Writes the four documents above as one, for clients that read a snapshot. */
static void put_snapshot(struct page *p)
{
    velodyne_pages_put(p, "{\"info\":");
    put_info(p);
    velodyne_pages_put(p, ",\"config\":");
    put_settings(p);
    velodyne_pages_put(p, ",\"status\":");
    put_status(p);
    velodyne_pages_put(p, ",\"diag\":");
    put_diag(p);
    velodyne_pages_put(p, "}");
}

static const struct {
    const char *path;
    void (*put)(struct page *p);
} pages[] = {
    {"/cgi/info.json", put_info}, {"/cgi/status.json", put_status},    {"/cgi/settings.json", put_settings},
    {"/cgi/diag.json", put_diag}, {"/cgi/snapshot.hdl", put_snapshot},
};
enum { N_PAGES = sizeof pages / sizeof pages[0] };

int velodyne_has_page(const char *path)
{
    for (int i = 0; i < N_PAGES; i++)
        if (strcmp(pages[i].path, path) == 0) return 1;
    return 0;
}

size_t velodyne_page(const struct protocol_spec *spec, const char *path, int64_t t_ns, char *dst, size_t cap)
{
    struct page p = {.spec = spec, .t_ns = t_ns, .dst = dst, .cap = cap};
    for (int i = 0; i < N_PAGES; i++) {
        if (strcmp(pages[i].path, path) != 0) continue;
        velodyne_read_state(spec, &p.state);
        pages[i].put(&p);
    }
    return p.len;
}
