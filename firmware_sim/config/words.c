#include "firmware_sim/config/words.h"

const char *const cfg_up_words[] = {[SCENE_UP_Z] = "z", [SCENE_UP_Y] = "y", NULL};
const char *const cfg_crs_words[] = {
    [GEOREF_LOCAL] = "local", [GEOREF_ECEF] = "ecef", [GEOREF_UTM] = "utm", [GEOREF_GEODETIC] = "geodetic", NULL};
const char *const cfg_georef_words[] = {[GEOREF_AUTO] = "auto",
                                        [GEOREF_EXACT] = "exact",
                                        [GEOREF_ORDER1] = "order1",
                                        [GEOREF_ORDER2] = "order2",
                                        [GEOREF_ORDER3] = "order3",
                                        [GEOREF_ORDER5] = "order5",
                                        NULL};
const char *const cfg_heights_words[] = {
    [HEIGHTS_ELLIPSOID] = "ellipsoid", [HEIGHTS_GEOID] = "geoid", [HEIGHTS_AUTO] = "auto", NULL};
const char *const cfg_anchor_words[] = {[ANCHOR_NONE] = "none", [ANCHOR_EXPLICIT] = "explicit", [ANCHOR_IFC] = "ifc",
                                        [ANCHOR_UTM] = "utm",   [ANCHOR_ECEF] = "ecef",         NULL};
const char *const cfg_hemisphere_words[] = {"south", "north", NULL};
const char *const cfg_layout_words[] = {[LINE_POLAR] = "polar", [LINE_GEO] = "geo", NULL};
const char *const cfg_link_words[] = {
    [LINK_NULL] = "null", [LINK_FILE] = "file", [LINK_PTY] = "pty", [LINK_TCP] = "tcp", [LINK_USB] = "usb", NULL};
const char *const cfg_protocol_words[] = {[PROTOCOL_NATIVE] = "native", [PROTOCOL_NMEA] = "nmea", NULL};
const char *const cfg_talker_words[] = {[TALKER_GN] = "GN", [TALKER_GP] = "GP", NULL};
const char *const cfg_backend_words[] = {
    [USB_BACKEND_USBIP] = "usbip", [USB_BACKEND_USBREDIR] = "usbredir", [USB_BACKEND_FUNCTIONFS] = "functionfs", NULL};
const char *const cfg_speed_words[] = {
    [USB_RATE_FULL] = "full", [USB_RATE_HIGH] = "high", [USB_RATE_SUPER] = "super", NULL};
const char *const cfg_pace_words[] = {[PACE_REALTIME] = "realtime", [PACE_FAST] = "fast", [PACE_STEP] = "step", NULL};

const char *const cfg_platform_words[] = {[PLATFORM_STATIC] = "static",
                                          [PLATFORM_TRAJECTORY] = "trajectory",
                                          [PLATFORM_LIVE] = "live",
                                          [PLATFORM_STOPS] = "stops",
                                          NULL};
const char *const cfg_range_noise_words[] = {
    [RANGE_NOISE_OFF] = "off", [RANGE_NOISE_ON] = "on", [RANGE_NOISE_SIGNAL] = "signal", NULL};
const char *const cfg_choice_words[] = {[CHOICE_AUTO] = "auto", [CHOICE_OFF] = "off", [CHOICE_ON] = "on", NULL};
const char *const cfg_axes_words[] = {"scene", "beam", NULL};
const char *const cfg_detection_words[] = {"noisy", "sharp", NULL};
const char *const cfg_ambiguity_words[] = {
    [DETECT_AMBIGUITY_NONE] = "none", [DETECT_FOLDED] = "folded", [DETECT_RESOLVED] = "resolved", NULL};
const char *const cfg_beam_words[] = {
    [BEAM_SINGLE] = "single", [BEAM_RINGS] = "rings", [BEAM_ADAPTIVE] = "adaptive", [BEAM_AUTO] = "auto", NULL};
const char *const cfg_echoes_words[] = {
    [BEAM_ALL] = "all", [BEAM_FIRST] = "first", [BEAM_LAST] = "last", [BEAM_STRONGEST] = "strongest", NULL};
const char *const cfg_at_end_words[] = {[PLATFORM_STOP] = "stop", [PLATFORM_HOLD] = "hold", NULL};
