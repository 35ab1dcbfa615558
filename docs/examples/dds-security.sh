#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# dds-security.sh FOLDER DOMAIN: certificates, governance and permissions (DDS Security) for a robot with locusd, in that
# DDS domain, valid for two years. Makes in FOLDER an enclave in the layout of ROS 2 for each participant:
#   locusd   publishes odometry, state, clouds, /tf, /diagnostics, itself as a node; subscribes to the inputs. For
#            dds.security in locusd.yaml
#   sensors  publishes the inputs, subscribes to nothing
#   viewer   subscribes to everything, publishes nothing
# FOLDER/ca holds the key that signs all of them: do not leave it on the robot. INPUTS in the environment lists the
# topics of motion_sources, health and flat ground, if they differ from those of the shipped locusd.yaml.
set -eu
[ $# -eq 2 ] || { echo "usage: dds-security.sh FOLDER DOMAIN" >&2; exit 2; }
command -v openssl >/dev/null || { echo "dds-security.sh: needs openssl: sudo apt install openssl" >&2; exit 1; }
folder=$1 domain=$2
inputs=${INPUTS:-/wheel_odometry /imu/data}
umask 077
mkdir -p "$folder"
[ ! -e "$folder/ca" ] || { echo "$folder/ca: is there already; name another folder" >&2; exit 1; }
mkdir "$folder/ca"
cd "$folder"

new_key() { openssl genpkey -quiet -algorithm EC -pkeyopt ec_paramgen_curve:P-256 -out "$1"; }
sign() { openssl smime -sign -text -in "$1" -out "$2" -signer ca/cert.pem -inkey ca/key.pem; }
topics() { for topic; do echo "          <topic>$topic</topic>" | sed 's,>/,>rt/,'; done; } # the names that ROS 2 uses in DDS
allow() { # publish|subscribe TOPIC...
  way=$1
  shift
  [ $# -eq 0 ] || printf '        <%s>\n        <topics>\n%s\n        </topics>\n        </%s>\n' "$way" "$(topics "$@")" "$way"
}

new_key ca/key.pem
openssl req -x509 -new -key ca/key.pem -days 730 -subj "/CN=locusd CA" -out ca/cert.pem

cat >ca/governance.xml <<XML
<?xml version="1.0" encoding="UTF-8"?>
<dds>
  <domain_access_rules>
    <domain_rule>
      <domains><id>$domain</id></domains>
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>SIGN</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>ENCRYPT</metadata_protection_kind>
          <data_protection_kind>NONE</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
XML
sign ca/governance.xml ca/governance.p7s

enclave() { # NAME RULES
  mkdir "$1"
  new_key "$1/key.pem"
  openssl req -new -key "$1/key.pem" -subj "/CN=$1" |
    openssl x509 -req -CA ca/cert.pem -CAkey ca/key.pem -CAcreateserial -days 730 -out "$1/cert.pem" 2>/dev/null
  cat >"ca/$1.xml" <<XML
<?xml version="1.0" encoding="UTF-8"?>
<dds>
  <permissions>
    <grant name="$1">
      <subject_name>CN=$1</subject_name>
      <validity>
        <not_before>$(date -u -d '-1 day' +%Y-%m-%dT%H:%M:%S)</not_before>
        <not_after>$(date -u -d '+730 days' +%Y-%m-%dT%H:%M:%S)</not_after>
      </validity>
      <allow_rule>
        <domains><id>$domain</id></domains>
$2
      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
XML
  sign "ca/$1.xml" "$1/permissions.p7s"
  cp ca/governance.p7s "$1/governance.p7s"
  cp ca/cert.pem "$1/identity_ca.cert.pem"
  cp ca/cert.pem "$1/permissions_ca.cert.pem"
}

# shellcheck disable=SC2086 # a list of topics
enclave locusd "$(allow publish '/locus/*' /tf /diagnostics ros_discovery_info; allow subscribe $inputs)"
# shellcheck disable=SC2086
enclave sensors "$(allow publish $inputs)"
enclave viewer "$(allow subscribe '/*' ros_discovery_info)"
