"""Real traffic: AIS history becomes a scenario (docs/real_traffic.md).

``fixes`` collects what the readers find, ``csv_files`` and ``nmea_logs`` read, ``clean`` turns fixes into tracks, ``scene``
puts them into a scenario.
"""
